"""Against real agents in the simulator: it needs XTB_FLEET_CLI."""

from __future__ import annotations

import asyncio
import json
import math
import tempfile
import unittest
from functools import partial
from pathlib import Path
from typing import Any

import zenoh
from rig import FakeRobot, Program, Sim, eventually, granted

from xtb_fleet import Fleet, FleetError, GoalEnded, Invalid, LeaseLost, NotAllowed, NotThere, OutcomeUnknown, Refused, Task
from xtb_fleet.robot import Robot

SIM: Sim


def setUpModule() -> None:
    global SIM
    SIM = Sim()
    SIM.watch()


def tearDownModule() -> None:
    SIM.end()


def off(robot: str, x: float, y: float) -> float:
    """How far a truck is from a place."""
    truth = SIM.truth(robot)
    return math.hypot(truth["x_m"] - x, truth["y_m"] - y)


class Setpoints:
    """What arrives on a robot's key for setpoints."""

    def __init__(self, robot: str) -> None:
        self.came: list[dict[str, Any]] = []
        self._subscriber = SIM.session.declare_subscriber(f"xtb/lab/{robot}/teleop/*", self._put)

    def _put(self, sample: zenoh.Sample) -> None:
        self.came.append(json.loads(sample.payload.to_bytes()))

    def end(self) -> None:
        self._subscriber.undeclare()  # type: ignore[no-untyped-call]


class Driving(unittest.TestCase):
    def setUp(self) -> None:
        self.fleet = SIM.connect()
        self.addCleanup(self.fleet.close)

    def robot(self, name: str) -> Robot:
        return self.fleet[name]

    def test_who_is_there_and_how_each_stands(self) -> None:
        robots = self.fleet.robots()
        self.assertEqual([robot.name for robot in robots], ["xtb-1", "xtb-2", "xtb-3"])
        self.assertTrue(all(robot.is_alive and robot.expected and robot.state for robot in robots))
        state = self.robot("xtb-1").state
        self.assertTrue(state.is_fresh and state.robot == "xtb-1" and state["epoch"] > 0)
        about = self.robot("xtb-1").about()
        assert about is not None
        self.assertEqual(about["hardware"], "simulated")
        self.assertIn("xtb-2", self.fleet._repr_html_())
        with self.assertRaises(NotThere):
            self.robot("xtb-99").state
        with self.assertRaises(Invalid):
            self.robot("all")

    def test_a_robot_drives_to_its_goal(self) -> None:
        robot = self.robot("xtb-1")
        with self.assertRaises(Invalid) as refused:
            robot.goto(0.0, 0.5)
        self.assertEqual(refused.exception.code, "lease_required")
        with robot.lease(), robot.events(timeout=30) as events:
            goal = robot.goto(0.1, 0.7)
            self.assertEqual(goal.wait(60).status, "reached")
            self.assertLess(off("xtb-1", 0.1, 0.7), 0.4)
            kinds = [next(events)["kind"] for _ in range(3)]
            self.assertTrue(any("goal" in kind for kind in kinds), kinds)
            far = robot.goto(0.1, 5.0)
            self.assertTrue(far.cancel())
            with self.assertRaises(GoalEnded) as ended:
                far.wait(60)
            self.assertEqual(ended.exception.code, "cancelled")
            self.assertFalse(far.cancel())
            with self.assertRaises(Refused) as range_:
                robot.goto(5000.0, 0.0)
            self.assertEqual(range_.exception.code, "out_of_range")
            with self.assertRaises(Invalid):
                robot.goto(math.nan, 0.0)
        eventually("the lease given back", lambda: robot.state.holder is None)

    def test_control_is_one_client_s_and_the_loser_is_told(self) -> None:
        robot = self.robot("xtb-2")
        with SIM.connect() as other, robot.lease() as lease:
            with self.assertRaises(Refused) as held:
                other["xtb-2"].lease().acquire()
            self.assertEqual(held.exception.code, "lease_held")
            self.assertIn(self.fleet.settings.client, held.exception.message)
            with robot.teleop() as hand, other["xtb-2"].lease(take=True) as taken:
                self.assertEqual(taken.taken_from, self.fleet.settings.client)
                eventually("the loss", lambda: lease.lost)
                with self.assertRaises(LeaseLost):
                    eventually("a refusal", lambda: hand.drive(1.0))
            with self.assertRaises(LeaseLost):
                robot.goto(2.0, 1.0)

    def test_nothing_is_sent_once_a_teleop_block_has_ended(self) -> None:
        robot, setpoints = self.robot("xtb-3"), Setpoints("xtb-3")
        self.addCleanup(setpoints.end)
        with robot.lease():
            with robot.teleop(deadman=1.0) as hand:

                def pushed() -> bool:
                    hand.drive(1.0, 0.1)
                    return bool(SIM.truth("xtb-3")["speed_mps"] > 0.1)

                eventually("driving", pushed)
            self.assertTrue(hand.stopped)
            eventually("the last setpoint", lambda: setpoints.came[-1]["seq"] == hand.sent)
            came = len(setpoints.came)
            SIM.simulated(1.0)
            self.assertEqual((len(setpoints.came), setpoints.came[-1]["rpm"]), (came, 0.0))
            seqs = [each["seq"] for each in setpoints.came]
            self.assertEqual(seqs, sorted(set(seqs)))
            self.assertIsNotNone(SIM.truth("xtb-3")["neutral_since_s"])
            with self.assertRaises(Invalid):
                hand.drive(1.0)

    def test_the_deadman_ends_what_nobody_repeats(self) -> None:
        robot, setpoints = self.robot("xtb-3"), Setpoints("xtb-3")
        self.addCleanup(setpoints.end)
        with robot.lease(), robot.teleop(deadman=0.5) as hand:
            hand.drive(-1.0)
            eventually("driving", lambda: SIM.truth("xtb-3")["neutral_since_s"] is None)
            eventually("the deadman", lambda: hand.expired == 1)
            eventually("neutral", lambda: SIM.truth("xtb-3")["neutral_since_s"])
            sent = hand.sent
            SIM.simulated(0.5)
            self.assertEqual((hand.sent, setpoints.came[-1]["rpm"]), (sent, 0.0))

    def test_an_error_in_a_teleop_block_stops_the_robot(self) -> None:
        robot = self.robot("xtb-3")
        with self.assertRaises(ZeroDivisionError), robot.lease(), robot.teleop(deadman=2.0) as hand:
            hand.drive(1.0)
            eventually("driving", lambda: SIM.truth("xtb-3")["neutral_since_s"] is None)
            raise ZeroDivisionError
        self.assertTrue(hand.stopped)
        eventually("neutral", lambda: SIM.truth("xtb-3")["neutral_since_s"])

    def test_states_come_as_they_are_and_a_slow_reader_loses_the_oldest(self) -> None:
        robot = self.robot("xtb-1")
        with robot.states(queue=2, timeout=30) as slow, robot.states(timeout=30) as stream:
            seqs = [next(stream)["seq"] for _ in range(10)]
            self.assertEqual(seqs, sorted(set(seqs)))
            eventually("a loss", lambda: slow.dropped > 3)
            self.assertGreater(next(slow)["seq"], seqs[0])
        self.assertEqual(list(stream), [], "it is closed")

    def test_an_emergency_stop_says_who_has_confirmed(self) -> None:
        robots = [self.robot(f"xtb-{number}") for number in (1, 2, 3)]
        report = self.fleet.estop_all()
        self.assertTrue(report.complete, report)
        self.assertEqual(report.confirmed, ["xtb-1", "xtb-2", "xtb-3"])
        for robot in robots:
            self.assertIn("estop", robot.state.latches)
            with robot.lease():
                with self.assertRaises(Refused) as latched:
                    robot.goto(0.0, 0.5)
                self.assertEqual(latched.exception.code, "latched")
                robot.reset()
        eventually("its end", lambda: not robots[0].state.latches)
        self.fleet.dispatch.activate()
        self.assertEqual(robots[1].estop().confirmed, ["xtb-2"])
        with robots[1].lease():
            robots[1].reset()
        self.assertEqual(robots[0].stop().confirmed, ["xtb-1"])
        silent = FakeRobot(SIM.session, "mute-1")
        self.addCleanup(silent.end)
        with Fleet.connect(SIM.endpoint, identity="none", timeout_s=2.0) as fleet:
            eventually("the other one", lambda: fleet["mute-1"].is_alive)
            report = fleet.stop_all()
        self.assertEqual(report.unconfirmed, ["mute-1"])
        self.assertFalse(report.complete)

    def test_tasks_are_done_and_changed(self) -> None:
        dispatch = self.fleet.dispatch
        ids = dispatch.submit(Task.goto(0.0, 1.0, who={"robot": "xtb-1"}), Task.wander(1.0, who={"robot": "xtb-2"}))
        self.assertEqual([task["state"] for task in dispatch.wait(ids, 60)], ["done", "done"])
        (task,) = dispatch.submit(Task.goto(3.0, 3.0, who={"robot": "xtb-1"}))
        dispatch.pause(task)
        eventually("paused", lambda: dispatch.show(task)["task"]["state"] == "paused")
        dispatch.resume(task)
        dispatch.cancel(task)
        with self.assertRaises(GoalEnded):
            dispatch.wait(task, 60)
        self.assertEqual(dispatch.show(task)["steps"][0]["state"], "queued")
        with self.assertRaises(Refused) as unknown:
            dispatch.submit(Task.goto(0.0, 0.0, who={"robot": "nobody"}))
        self.assertEqual(unknown.exception.code, "unknown_robot")
        (way,) = dispatch.submit(Task.route([(0.0, 1.0)], who={"robot": "xtb-1"}))
        for _ in range(2):  # the same again adds nothing
            self.assertIsNone(dispatch.extend(way, [(0.0, 1.5)], after=1)[0]["error"])
        self.assertEqual(dispatch.show(way)["task"]["legs"], 2)
        with self.assertRaises(Refused) as stale:
            dispatch.extend(way, [(0.0, 2.0)], after=7)
        self.assertEqual(stale.exception.code, "stale")
        dispatch.cancel(way)
        dispatch.retry(task)
        dispatch.cancel_all()
        self.assertIn(task, [each["id"] for each in dispatch.tasks()])

    def test_a_pose_is_set(self) -> None:
        robot = self.robot("xtb-2")
        with robot.lease():
            before = robot.state
            robot.set_pose(before.x + 0.1, before.y, before.yaw)
            eventually("the new pose", lambda: abs(robot.state.x - before.x - 0.1) < 0.05)
            robot.set_pose(before.x, before.y, before.yaw)

    def test_the_same_for_asyncio(self) -> None:
        asyncio.run(self.drive_async())

    async def drive_async(self) -> None:
        async with Fleet.connect_async(SIM.endpoint, identity="none", timeout_s=10.0) as fleet:
            robot = fleet["xtb-2"]
            async with robot.lease():
                place = await robot.state()
                goal = await robot.goto(place.x, place.y + 0.5)
                seen = 0
                async for state in robot.states(timeout=30):
                    seen += 1
                    if state.goal and state.goal["id"] == goal.sync.id:
                        break
                self.assertGreater(seen, 0)
                self.assertEqual((await goal.wait(60)).status, "reached")
                async with robot.teleop() as hand:
                    hand.drive(-0.5)
                self.assertTrue(hand.sync.stopped)
            waiting = asyncio.create_task(_acquire(fleet["xtb-3"]))
            await asyncio.sleep(0)
            waiting.cancel()
            with self.assertRaises(asyncio.CancelledError):
                await waiting
            (task,) = await fleet.dispatch.submit(Task.wander(0.5, who={"robot": "xtb-2"}))
            self.assertEqual((await fleet.dispatch.wait(task, 60))[0]["state"], "done")
            self.assertTrue((await fleet.stop_all()).robots)
        eventually("nothing left behind", lambda: self.robot("xtb-3").state.holder is None)


def _always(answer: dict[str, Any] | bytes | None, _: dict[str, Any]) -> dict[str, Any] | bytes | None:
    return answer


async def _acquire(robot: Any) -> None:
    async with robot.lease():
        await asyncio.Event().wait()


class Lies(unittest.TestCase):
    """Robots that are none."""

    def setUp(self) -> None:
        self.fleet = Fleet.connect(SIM.endpoint, identity="none", timeout_s=2.0)
        self.addCleanup(self.fleet.close)
        self.fake = FakeRobot(SIM.session, "fake-1")
        self.addCleanup(self.fake.end)
        key = "xtb/lab/fake-1/alive"
        eventually("presence", lambda: key in self.fleet._link.present(key))

    def test_a_request_is_asked_again_with_its_id(self) -> None:
        def answer(request: dict[str, Any]) -> dict[str, Any] | bytes | None:
            ids = [each["id"] for each in self.fake.requests if "reset" in each["body"]]
            return granted(request) if "reset" not in request["body"] or len(ids) > 2 else None

        self.fake.answer = answer
        with self.fleet["fake-1"].lease():
            self.fleet["fake-1"].reset()
            eventually("retains", lambda: sum("retain" in each["body"] for each in self.fake.requests) > 3)
        resets = [each["id"] for each in self.fake.requests if "reset" in each["body"]]
        self.assertEqual((len(resets), len(set(resets))), (3, 1))
        self.assertTrue(any("release" in each["body"] for each in self.fake.requests))

    def test_silence_is_an_unknown_outcome_and_nonsense_is_silence(self) -> None:
        wrong = granted({"id": "00112233-4455-6677-8899-aabbccddeeff"})
        answers: list[dict[str, Any] | bytes | None] = [None, b"\xff{", wrong, {"id": 3}]
        for nonsense in answers:
            self.fake.answer = partial(_always, nonsense)
            with self.assertRaises(OutcomeUnknown) as unknown:
                self.fleet["fake-1"].lease().acquire()
            self.assertEqual(unknown.exception.code, "outcome_unknown")

    def test_a_goal_of_unknown_outcome_is_taken_back(self) -> None:
        self.fake.answer = lambda request: None if "goto" in request["body"] else granted(request)
        with self.fleet["fake-1"].lease():
            with self.assertRaises(OutcomeUnknown) as unknown:
                self.fleet["fake-1"].goto(1.0, 1.0)
            self.assertIn("had started and was cancelled", unknown.exception.message)
        goals = {each["id"] for each in self.fake.requests if "goto" in each["body"]}
        cancelled = {each["body"]["cancel"]["goal"] for each in self.fake.requests if "cancel" in each["body"]}
        self.assertEqual(goals, cancelled)

    def test_who_only_says_yes_has_not_stopped(self) -> None:
        self.fake.answer = granted
        self.assertEqual(self.fleet["fake-1"].stop().robots, {"fake-1": "unconfirmed"})

    def test_states_that_are_none_are_counted_and_not_shown(self) -> None:
        state = json.loads((Path(__file__).parent / "state.json").read_text("utf-8"))
        feed = self.fleet["fake-1"]._states()
        bad: list[bytes | str] = [b"", b"[]", json.dumps(state), json.dumps(state | {"robot": "fake-1", "seq": -0.5}), b"0" * 100_000]

        def all_came() -> bool:
            for each in bad:
                self.fake.publish("state/json", each)
            return feed.unreadable >= len(bad)

        eventually("all of them", all_came)
        self.assertEqual(feed.last, {})

        def a_good_one() -> bool:
            self.fake.publish("state/json", json.dumps(state | {"robot": "fake-1"}))
            return "fake-1" in feed.last

        eventually("a good one", a_good_one)


class Elsewhere(unittest.TestCase):
    def test_nobody_there_is_said_so(self) -> None:
        with self.assertRaises(NotThere) as nobody:
            Fleet.connect("tcp/127.0.0.1:1", identity="none", timeout_s=0.3)
        self.assertEqual(nobody.exception.code, "no_router")
        with SIM.connect(fleet="hall") as fleet:
            self.assertEqual(fleet.robots(), [])
            with self.assertRaises(NotThere) as dispatcher:
                fleet.dispatch.tasks()
            self.assertEqual(dispatcher.exception.code, "no_dispatcher")
            self.assertFalse(fleet.estop_all(0.3).complete)
        with self.assertRaises(Invalid):
            fleet.dispatch.tasks()

    def test_identities_are_used_as_by_the_programs(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            sim = Sim(1, "--identities", folder, "--listen", "tls/127.0.0.1:0")
            try:
                operator, viewer = Path(folder) / "operator", Path(folder) / "viewer"
                with self.assertRaises(Invalid):
                    Fleet.connect(SIM.endpoint, identity=operator)
                with Fleet.connect(sim.endpoint, identity=operator, timeout_s=10.0) as fleet:
                    assert fleet.settings.identity is not None
                    self.assertTrue(fleet.settings.client.startswith(f"{fleet.settings.identity.name}-"))
                    with fleet["xtb-1"].lease():
                        self.assertEqual(fleet["xtb-1"].goto(0.0, 0.5).wait(60).status, "reached")
                with Fleet.connect(sim.endpoint, identity=viewer, timeout_s=10.0) as fleet:
                    self.assertEqual(next(fleet["xtb-1"].states(timeout=30)).robot, "xtb-1")
                    with self.assertRaises(NotAllowed):
                        fleet["xtb-1"].lease().acquire()
                    self.assertEqual(fleet["xtb-1"].estop().confirmed, ["xtb-1"])
            finally:
                sim.end()


class Recording(unittest.TestCase):
    def test_what_was_seen_is_what_a_recording_holds(self) -> None:
        try:
            from mcap.reader import make_reader
        except ImportError:
            self.skipTest("no package mcap")
        with tempfile.TemporaryDirectory() as folder, SIM.connect() as fleet:
            file = Path(folder) / "lab.mcap"
            recorder = Program("--connect", SIM.endpoint, "record", "--out", str(file))
            seen: dict[tuple[str, int], Any] = {}
            robot = fleet["xtb-1"]
            with robot.lease(), fleet.states(queue=2000, timeout=30) as stream:
                place = robot.state
                goal = robot.goto(place.x + 0.2, place.y + 0.4)
                while goal.status not in ("reached", "failed"):
                    state = next(stream)
                    seen[state.robot, state["seq"]] = state.data
                self.assertEqual(stream.dropped, 0)
            recorder.end()
            recorded: dict[tuple[str, int], Any] = {}
            with file.open("rb") as stream_of_bytes:
                for _, channel, message in make_reader(stream_of_bytes).iter_messages():
                    if channel.topic.startswith("xtb/lab/xtb-") and channel.topic.endswith("/state"):
                        data = json.loads(message.data)
                        recorded[data["robot"], data["seq"]] = data
        both = seen.keys() & recorded.keys()
        self.assertGreater(len(both), 0.9 * len(seen), f"{len(seen)} seen, {len(recorded)} recorded")
        for each in both:
            self.assertEqual(seen[each], recorded[each])


if __name__ == "__main__":
    unittest.main()
