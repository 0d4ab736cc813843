"""Messages as they stand on the wire in JSON. Made by generate_types.py: not to be edited.

A newer robot may say more: other fields, and other words where a `Literal` lists those of today.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict, Union

class About(TypedDict):
    """The factsheet."""
    capabilities: list[str]
    """Which requests it understands."""
    epoch: int
    """Random at boot."""
    fleet: Name
    """Of which fleet."""
    hardware: str
    """`simulated` or `serial`."""
    limits: Limits
    """What it accepts at most."""
    robot: Name
    """Who."""
    start_pose: MapPose
    """Where it started."""
    vehicle: list[ParameterInfo]
    """The vehicle parameters, [`REALTIME`] and [`SPEAKS`]."""
    vehicle_hash: str
    """CRC-32 of the vehicle parameters, in hexadecimal."""
    version: str
    """The agent's version."""


class Adopted(TypedDict):
    """Which tasks were taken over to the fleet's map."""
    map: str | None
    """The map; `None` = the fleet has none."""
    tasks: list[TaskId]
    """Those that were of another one, oldest first."""


class Arc(TypedDict):
    """One arc or straight, driven in one gear."""
    curvature_per_m: float
    """+ = to the left when driven ahead."""
    length_m: float
    """Way of the middle between the axles, in m; negative = astern."""


BatteryLevel = Literal["unknown", "ok", "warn", "finish", "critical"]
"""What the battery's voltage means, a few seconds of load left out."""


DispatchCode = Literal["malformed", "out_of_range", "queue_full", "unknown_robot", "unknown_tag", "unknown_capability", "deadline_past", "keep_out", "goal_blocked", "ledger_failed", "unknown_task", "wrong_state", "unconfirmed", "overloaded", "stale"]
"""Why the dispatcher refused."""


class DispatchError(TypedDict):
    """A refusal, for people and programs."""
    code: DispatchCode
    """For programs."""
    hint: str
    """What to do."""
    message: str
    """What was wrong; names the task of a submission where one is to blame."""


class DispatchOutcome(TypedDict, total=False):
    """What the dispatcher answers."""
    submitted: list[TaskId]
    """Taken, and in the ledger; in the order of the submission."""
    changed: list[TaskChange]
    """What became of each task; of more than [`PAGE_BYTES`] first those that are not as
    asked."""
    shown: TaskHistory
    """The task and its history."""
    error: DispatchError
    """Nothing was done."""
    activated: Suspension | None
    """Tasks are assigned again; the suspension that this has ended, `None` = there was none."""
    adopted: Adopted
    """What was taken over."""
    status: DispatchStatus
    """How it stands."""


class DispatchReply(TypedDict):
    """The answer to a request."""
    id: str
    """The request's id; nil if it could not be read."""
    left_out: int
    """Changes that were made and are not in the answer, for want of room."""
    result: DispatchOutcome
    """What came of it."""
    suspended: list[Suspension]
    """What is suspended; empty in the refusal of a question that could not be read."""


class DispatchStatus(TypedDict):
    """How the dispatcher stands."""
    assigned: int
    """Those of them that a robot has."""
    ledger: int
    """Number of the ledger."""
    ledger_failed: str | None
    """Why the ledger cannot be written now, if it cannot."""
    map: str | None
    """The map that tasks are taken for; `None` = no map is known."""
    open: int
    """Those of them that have not ended."""
    robots: int
    """Robots that are heard now."""
    tasks: int
    """Tasks that are remembered."""


class Done(TypedDict):
    """What a successful request gave."""
    goal: str | None
    """From `goto` and `wander`."""
    lease: Lease | None
    """From `acquire`."""


class ErrorBody(TypedDict):
    """A refusal, for people and programs."""
    code: RejectCode
    """For programs."""
    hint: str
    """What to do."""
    message: str
    """What was wrong."""


class Estopped(TypedDict):
    """A robot's acknowledgement of an emergency stop."""
    latched: bool
    """Whether the latch `estop` is set now."""
    robot: Name
    """Who stands."""


class Event(TypedDict):
    """An event with its place in the robot's history."""
    epoch: int
    """Random at boot."""
    kind: EventKind
    """What happened."""
    robot: Name
    """Whose."""
    seq: int
    """Counts the events of this boot."""
    tick_ms: int
    """The robot's monotonic clock."""


class EventKindStarted(TypedDict):
    """The agent began to run."""
    version: str
    """Its version."""


EventKindMode = TypedDict("EventKindMode", {"from": "Mode", "to": "Mode"})
"""The controller's mode changed."""


class EventKindGoal(TypedDict):
    """A goal changed its status."""
    id: str
    """Which."""
    reason: str | None
    """Why, where that is not plain."""
    status: GoalStatus
    """To what."""


class EventKindLease(TypedDict):
    """The lease changed hands."""
    holder: Name | None
    """To whom; `None` = free."""


class EventKindFault(TypedDict):
    """Something broke, or works again."""
    detail: str | None
    """The system's words, where there are any."""
    fault: Fault
    """What."""
    present: bool
    """False: it works again."""


class EventKindLatch(TypedDict):
    """A stop was latched, or reset."""
    by: str
    """Who or what did so."""
    latch: Latch
    """Which."""
    set: bool
    """False: it was reset."""


class EventKind(TypedDict, total=False):
    """Something happened."""
    started: EventKindStarted
    """The agent began to run."""
    mode: EventKindMode
    """The controller's mode changed."""
    goal: EventKindGoal
    """A goal changed its status."""
    lease: EventKindLease
    """The lease changed hands."""
    fault: EventKindFault
    """Something broke, or works again."""
    latch: EventKindLatch
    """A stop was latched, or reset."""


Fault = Literal["board_unplugged", "board_busy", "board_no_permission", "board_port_broken", "board_silent", "board_garbage", "board_half_frames", "board_wrong_device", "board_not_set_up", "gyro_unplugged", "gyro_busy", "gyro_no_permission", "gyro_port_broken", "gyro_silent", "gyro_garbage", "gyro_half_frames", "gyro_wrong_device", "encoder_silent", "converter_silent", "remote_lost", "tilt_out_of_range", "recording_failed", "board_frozen", "gyro_frozen", "encoder_out_of_range", "converter_frozen", "infrared_frozen", "infrared_out_of_range", "runaway", "stalled", "battery_low", "battery_critical", "odometry_scale", "fixes_frozen", "fixes_contradict"]
"""Something that is broken now. The first part of a name says where."""


class FaultState(TypedDict):
    """A fault with its age."""
    age_ms: int
    """Since it was noticed."""
    detail: str | None
    """The system's words, where there are any."""
    fault: Fault
    """Which."""


class GoalEnd(TypedDict):
    """How an earlier goal ended."""
    id: str
    """Its request's id."""
    status: GoalStatus
    """As what."""


GoalKind = Literal["goto", "wander"]
"""What kind of goal."""


class GoalState(TypedDict):
    """The present or last goal."""
    age_ms: int
    """Since it has this status."""
    by: Name
    """Who sent it."""
    distance_m: float | None
    """Still to go, in a straight line."""
    id: str
    """Its request's id."""
    kind: GoalKind
    """What kind."""
    on_link_loss: LinkLoss
    """What it does when its client falls silent."""
    reason: str | None
    """Why it has this status, where that is not plain."""
    status: GoalStatus
    """How it stands."""
    via: Via | None
    """How it is driven to; `None` for wander."""
    x_m: float | None
    """East, in m; `None` for wander."""
    y_m: float | None
    """North, in m; `None` for wander."""
    yaw_rad: float | None
    """Yaw on arrival, where one was asked for."""


GoalStatus = Literal["accepted", "running", "blocked", "reached", "cancelled", "replaced", "failed", "interrupted"]
"""The life of a goal."""


class IdentityStatus(TypedDict):
    """Whether, and as what, a router admits an identity. Whoever has any certificate of the
    fleet may ask, so that one who is not admitted learns why."""
    generation: int
    """The certificate that is admitted; 0 = none is."""
    name: Name
    """Whose."""
    revoked: bool
    """Not admitted any more."""
    role: str | None
    """Its role as in the registry; `None` = the registry does not have it."""
    waiting: bool
    """Admitted by the registry, and by the router when no robot is driven. Since version 2."""


class InputAges(TypedDict):
    """Ages of the inputs in ms; `None` = never heard."""
    adc: int | None
    """Converter scan."""
    encoder: int | None
    """Encoder window."""
    gyro: int | None
    """Gyro frame."""
    remote: int | None
    """Frame of the remote control; `None` also for a truck without a receiver."""
    setpoint: int | None
    """Accepted setpoint."""


Latch = Literal["estop", "remote_takeover", "board_lost", "gyro_lost", "runaway", "sensor_fault", "battery_critical"]
"""Why a robot stands until somebody resets it."""


class LatchState(TypedDict):
    """A latch that is set."""
    age_ms: int
    """Since it was set."""
    by: str
    """Who or what set it: a client's name, a fault."""
    latch: Latch
    """Which."""
    present: bool
    """Whether what set it is still so: then a reset is refused."""


class Lease(TypedDict):
    """Proof that the robot granted control: which boot, and which grant of it."""
    epoch: int
    """Random at the robot's boot, below 2^53."""
    root: int
    """Raised by each grant to a new holder."""


class LeaseState(TypedDict):
    """Who holds control."""
    age_ms: int
    """Since its last lease-bearing message."""
    holder: Name
    """The client."""


class Limits(TypedDict):
    """What the robot accepts at most."""
    admitted_mps: float
    """Fastest speed that the obstacle rule stops from, in m/s."""
    max_coordinate_m: float
    """Largest |x| or |y| of a goal."""
    max_rpm: float
    """Fastest setpoint, in wheel rpm."""
    setpoint_lifetime_ms: int
    """How long a setpoint lives."""


LinkLoss = Literal["halt", "finish"]
"""What a goal does when its client falls silent."""


class MapPose(TypedDict):
    """A pose in the map."""
    x_m: float
    """East, in m."""
    y_m: float
    """North, in m."""
    yaw_rad: float
    """Counter-clockwise from +x, in (−π, π]."""


class MapState(TypedDict):
    """The map a robot plans on."""
    fleet_hash: str | None
    """The hash of the fleet's map, if another one is published: no planned goals then."""
    hash: str
    """Its hash, in hexadecimal."""
    name: str
    """Its name."""


Mode = Literal["idle", "manual", "teleop", "goto", "wander", "fault"]
"""What the controller is doing."""


Name = str
"""The name of a fleet, a robot or a client: 1–32 of `a-z 0-9 -`."""


NavPhase = Literal["planning", "following", "waiting", "recovering"]
"""What a planned goal is at."""


class NavState(TypedDict):
    """Map and path of a robot."""
    fixes: int
    """Fixes that were accepted since boot."""
    map: MapState | None
    """The map; `None` = it has none."""
    route: RouteState | None
    """The present planned goal's path."""
    traffic: bool
    """Whether traffic control has been heard within the last 3 s."""


class ObstacleView(TypedDict):
    """The obstacle rule's view; `None` = the range finders have not been heard lately."""
    front: bool | None
    """Ahead."""
    rear: bool | None
    """Behind."""


OnTakeover = Literal["requeue", "resume", "fail"]
"""What becomes of a task whose robot somebody else has taken over, or told to stop."""


class Outcome(TypedDict, total=False):
    """`ok` or `error`."""
    ok: Done
    """Done."""
    error: ErrorBody
    """Refused; nothing changed."""


class ParameterInfo(TypedDict):
    """A parameter as the factsheet lists it."""
    name: str
    """`section.field`."""
    origin: str
    """Printed, data sheet, assumed or ours."""
    unit: str
    """Empty for switches."""
    value: str
    """In TOML; of [`REALTIME`] in words."""


PoseSource = Literal["start", "odometry", "fixes"]
"""Where a pose comes from."""


class PoseState(TypedDict):
    """The pose in the map (ENU, REP-103)."""
    age_ms: int | None
    """Age of the older of the two samples behind it; `None` = never measured."""
    fix_age_ms: int | None
    """Since the last accepted fix; `None` = none since boot or `set_pose`."""
    fix_delay_ms: int | None
    """By how much fixes are older than they say, as estimated from the motion; `None` = not
    known."""
    odometry_scale: float | None
    """Way driven for each metre that the encoder counts, as pose fixes have shown: 1 = what the
    settings say; `None` = not known, there was no fix."""
    odometry_scale_sigma: float | None
    """Standard deviation of `odometry_scale`."""
    sigma_m: float
    """Standard deviation along the worse direction, in m."""
    sigma_yaw_rad: float
    """Standard deviation of the yaw."""
    source: PoseSource
    """Where it comes from."""
    x_m: float
    """East, in m."""
    y_m: float
    """North, in m."""
    yaw_rad: float
    """Counter-clockwise from +x."""


RejectCode = Literal["malformed", "oversized", "wrong_version", "out_of_range", "lease_held", "lease_lost", "busy", "unknown_goal", "not_ready", "unsupported", "overloaded", "overtaken", "lease_required", "latched", "cause_present", "battery_low", "no_map", "keep_out", "goal_blocked"]
"""Why a request was refused."""


class Rejected(TypedDict):
    """What was refused or dropped since boot."""
    board_frames: int
    """Board frames dropped: CRC, type, range."""
    board_lost: int
    """Gaps in the board's sequence."""
    board_repeated: int
    """Board frames that came again."""
    events_dropped: int
    """Events that fell out of their full queue."""
    fenced: int
    """Setpoints without the present lease."""
    fixes: int
    """Pose fixes that were too old or too far off to be true."""
    gyro_bytes: int
    """Bytes skipped to find a gyro frame."""
    gyro_lost: int
    """Gyro frames that its own clock says are missing."""
    malformed: int
    """Messages that could not be read."""
    out_of_range: int
    """Messages with a number out of range."""
    overloaded: int
    """Requests that found the queue full."""
    oversized: int
    """Messages that were too long."""
    record_dropped: int
    """Steps that the recorder could not keep."""
    refused: int
    """Requests that were read and refused."""
    remote_readings: int
    """Readings of the remote control that were missing or rejected."""
    setpoints_overwritten: int
    """Setpoints that were replaced by newer ones before a turn saw them."""
    stale: int
    """Setpoints that were too old, repeated, or overtaken by a later stop or goal."""
    wrong_version: int
    """Messages of another version."""


class Reply(TypedDict):
    """The answer to a request."""
    id: str
    """The request's id; nil if it could not be read."""
    result: Outcome
    """What came of it."""


class RobotState(TypedDict):
    """Everything about a robot, 20 times a second."""
    battery_level: BatteryLevel
    """What that means."""
    battery_v: float | None
    """`None` = not measured."""
    ended_goals: list[GoalEnd]
    """How the goals before it ended, newest first; at most 8."""
    epoch: int
    """Random at boot."""
    faults: list[FaultState]
    """What is broken, with the newest last."""
    goal: GoalState | None
    """The present or last goal."""
    input_age_ms: InputAges
    """Ages of the inputs."""
    latches: list[LatchState]
    """Latched stops, oldest first."""
    lease: LeaseState | None
    """Who holds control."""
    mode: Mode
    """What the controller does."""
    nav: NavState
    """Map, path and who leads along it."""
    obstacle: ObstacleView
    """What the range finders see."""
    pose: PoseState
    """Where it is."""
    reference_rpm: float
    """What the mode demands of the wheels, in rpm."""
    rejected: Rejected
    """What was refused or dropped."""
    robot: Name
    """Whose."""
    seq: int
    """Counts the states."""
    speed_mps: float | None
    """+ = ahead; `None` = the encoder has not been heard lately."""
    steering: float
    """Commanded, −1..=1, + = right."""
    stopped_age_ms: int | None
    """Since when it stands; `None` while it drives."""
    stopped_because: list[StopReason]
    """Why it stands, what weighs most first; empty while it drives."""
    tick_ms: int
    """The robot's monotonic clock."""
    tilt_deg: TiltState
    """Platform tilt."""
    turn_late_us: int
    """How late the latest turn of the control loop since the last state was; it should be under
    5000."""
    turns_late: int
    """Turns since boot that came more than 5 ms after their time."""


class Roster(TypedDict):
    """Which robots should be there."""
    robots: list[RosterEntry]
    """In the order of their names' numbers; at most [`MAX_ROSTER`], each once."""


class RosterEntry(TypedDict):
    """A robot that should be there."""
    name: Name
    """Its name."""
    start_pose: MapPose | None
    """Where it starts."""
    tags: list[str]
    """What it can do or belongs to."""


RouteSource = Literal["own", "traffic"]
"""Who made a path."""


class RouteState(TypedDict):
    """The path of the present goal."""
    blocked_at_m: list[Any] | None
    """Where something unknown is in its way, (x, y) in m."""
    done_m: float
    """Driven along it, in m."""
    off_m: float
    """Beside the path, in m."""
    phase: NavPhase
    """What it is at."""
    plan: int
    """Number of the coordinator's plan; 0 for an own one."""
    plans: int
    """Paths planned for this goal."""
    release_m: float
    """Released, in m."""
    source: RouteSource
    """Who made it."""
    track: Track | None
    """The path; `None` while there is none."""
    waits_for: Name | None
    """Who has to pass first."""


StopReason = Literal["no_command", "goal_reached", "stop", "cancelled", "time_up", "setpoint_expired", "link_lost", "setpoint_zero", "obstacle_front", "obstacle_rear", "wander_pause", "board_lost", "gyro_lost", "remote_neutral", "remote_lost", "estop", "remote_takeover", "runaway", "sensor_fault", "battery_critical", "lease_expired", "lease_taken", "lease_released", "loop_stalled", "stalled", "over_speed", "changing_direction", "coasting", "starting", "planning", "waiting_for_traffic", "giving_way", "way_blocked", "pose_uncertain", "in_keep_out", "at_cusp"]
"""Why a robot stands."""


class Suspension(TypedDict):
    """Tasks that no robot is given, although it could do them."""
    cause: SuspensionCause
    """Why."""
    since_ms: int
    """Since when, in ms since 1970; of another map: since the dispatcher was told of it."""
    tasks: int
    """Tasks that have not ended and wait for it."""


class SuspensionCauseFleetStop(TypedDict):
    """An emergency stop of all robots: nothing is assigned, until `activate`."""
    by: Name | None
    """Who called for it; `None` = nobody knows."""


class SuspensionCauseOtherMap(TypedDict):
    """Tasks were submitted for another map than the fleet has now: they wait for that map, or
    for `adopt`."""
    now: str
    """The fleet's."""
    of: str | None
    """Theirs; `None` = the ledger is older than such names."""


class SuspensionCause(TypedDict, total=False):
    """Why tasks are suspended."""
    fleet_stop: SuspensionCauseFleetStop
    """An emergency stop of all robots: nothing is assigned, until `activate`."""
    other_map: SuspensionCauseOtherMap
    """Tasks were submitted for another map than the fleet has now: they wait for that map, or
    for `adopt`."""


class TaskChange(TypedDict):
    """What became of one task of a request."""
    error: DispatchError | None
    """Why it is not as asked."""
    id: TaskId
    """Which."""
    state: TaskState | None
    """How it stands now; `None` = there is no such task."""


class TaskHistory(TypedDict):
    """A task and how it came to be so."""
    left_out: int
    """Steps that were left out after the first, for want of room."""
    steps: list[TaskStep]
    """Oldest first."""
    task: TaskView
    """As it is now."""


TaskId = str
"""What a task is called: `t17`. Counted by the ledger, never given twice."""


class TaskKindGoto(TypedDict):
    """Drive to a point."""
    to: Waypoint
    """Where to."""


class TaskKindRoute(TypedDict):
    """Drive along points."""
    dwell_s: float
    """How long to stand at each, in s."""
    loops: int
    """How often."""
    points: list[Waypoint]
    """In this order."""


class TaskKindPatrol(TypedDict):
    """Drive along points again and again."""
    dwell_s: float
    """How long to stand at each, in s."""
    for_s: float | None
    """How long altogether, in s; `None` = until cancelled."""
    points: list[Waypoint]
    """In this order."""


class TaskKindWander(TypedDict):
    """Wander."""
    for_s: float
    """How long, in s."""


class TaskKind(TypedDict, total=False):
    """What is to be done."""
    goto: TaskKindGoto
    """Drive to a point."""
    route: TaskKindRoute
    """Drive along points."""
    patrol: TaskKindPatrol
    """Drive along points again and again."""
    wander: TaskKindWander
    """Wander."""


class TaskList(TypedDict):
    """Tasks that are remembered, oldest first: all of them, or as many as there is room for. A
    page (`tasks?after=t17`) has those that follow `t17`; the next page begins after its last
    one. Ids only grow, so that pages name each task once, as it was at the time of its page.
    What is published, and answered without `after`, has those with a robot first, then the
    others that have not ended, then those that ended last: of these what is published has 100
    at most."""
    at_ms: int
    """When, in ms since 1970."""
    ledger: int
    """Number of the ledger."""
    ledger_failed: str | None
    """Why the ledger cannot be written now, if it cannot."""
    left_out: int
    """Tasks that are remembered and not in here: of a page, those that follow its last one."""
    suspended: list[Suspension]
    """What is suspended."""
    tasks: list[TaskView]
    """The tasks."""


class TaskSpec(TypedDict):
    """A task as it is submitted."""
    deadline_ms: int | None
    """When it must be done, in ms since 1970; else it has failed."""
    finish_s: float
    """How long one drive may take with [`LinkLoss::Finish`], in s."""
    grace_s: float
    """How long it waits for a robot that is gone or taken, in s."""
    kind: TaskKind
    """What is to be done."""
    on_link_loss: LinkLoss
    """What its robot does when it does not hear the dispatcher."""
    on_takeover: OnTakeover
    """When somebody else takes its robot."""
    priority: int
    """0 = when nothing else is to be done, 9 = first."""
    retries: int
    """How often it is begun anew after it has failed on a robot."""
    who: Who
    """Who may do it."""


TaskState = Literal["queued", "assigned", "running", "blocked", "held", "paused", "cancelling", "done", "failed", "cancelled"]
"""How a task stands."""


class TaskStep(TypedDict):
    """One change in a task's life."""
    at_ms: int
    """When, in ms since 1970."""
    legs_done: int
    """Drives that were done then."""
    reason: str | None
    """Why, where that is not plain."""
    robot: Name | None
    """On which robot."""
    state: TaskState
    """To what."""


class TaskView(TypedDict):
    """A task as lists show it."""
    by: Name
    """Who submitted it."""
    failures: int
    """How often it has failed on a robot."""
    id: TaskId
    """Its name."""
    legs: int | None
    """Drives altogether; `None` = until the time is up."""
    legs_done: int
    """Drives that are done."""
    map: str | None
    """The map that it was submitted for; `None` = none was known then."""
    reason: str | None
    """Why, where that is not plain."""
    robot: Name | None
    """On which robot it is, or ended; `None` = on none."""
    since_ms: int
    """Since when, in ms since 1970."""
    spec: TaskSpec
    """As submitted."""
    state: TaskState
    """How it stands."""
    submitted_ms: int
    """When, in ms since 1970."""


class TiltState(TypedDict):
    """Platform tilt; `None` = not measured."""
    x: float | None
    """Pitch, in degrees."""
    y: float | None
    """Roll, in degrees."""


class Track(TypedDict):
    """A path: a start, and arcs from there."""
    arcs: list[Arc]
    """In the order in which they are driven; at most [`Track::MOST_ARCS`]."""
    start: MapPose
    """Where it begins."""


Via = Literal["direct", "planned"]
"""How a goal is driven to."""


class Waypoint(TypedDict):
    """A place to drive to."""
    x_m: float
    """East, in m."""
    y_m: float
    """North, in m."""
    yaw_rad: float | None
    """Yaw on arrival, counter-clockwise from +x; `None` = any."""


class WhoChoice(TypedDict, total=False):
    """Who may do a task."""
    robot: Name
    """This one."""
    tag: str
    """One that bears this tag in the roster."""
    able: str
    """One whose factsheet names this capability."""


Who = Union[Literal["any"], WhoChoice]
"""Who may do a task."""


class Assignment(TypedDict):
    """One drive of a task on a robot."""
    assign_seq: int
    """Number of the assignment; of two of a ledger the later has the higher one."""
    ledger: int
    """The ledger that the task stands in, random at its making, at most 48 bits."""
    leg: int
    """Which of the task's drives, counted from 0 over all its rounds."""
    task: TaskId
    """The task."""


class BodyAcquire(TypedDict, total=False):
    """Ask for the lease."""
    take: bool
    """Take it from its holder."""


class _BodyGotoAlways(TypedDict):
    x_m: float
    """East, in m."""
    y_m: float
    """North, in m."""


class BodyGoto(_BodyGotoAlways, total=False):
    """Drive to a point of the map."""
    finish_s: float
    """Longest time that a goal with [`LinkLoss::Finish`] may take, in s."""
    on_link_loss: LinkLoss
    """When the client falls silent."""
    via: Via | None
    """How; `None` = planned as soon as the robot has a map, else direct."""
    yaw_rad: float | None
    """Yaw on arrival, counter-clockwise from +x; only by a planned path."""


class BodyWander(TypedDict, total=False):
    """Wander (§4.6)."""
    finish_s: float
    """See [`Body::Goto`]."""
    for_s: float | None
    """How long, in s; `None` = until stopped."""
    on_link_loss: LinkLoss
    """When the client falls silent."""


class BodyCancel(TypedDict):
    """End this goal if it is the one that runs."""
    goal: str
    """Its id."""


class BodySetPose(TypedDict):
    """Tell the robot where it stands in the map; refused while a goal runs."""
    x_m: float
    """East, in m."""
    y_m: float
    """North, in m."""
    yaw_rad: float
    """Counter-clockwise from +x."""


class BodyReset(TypedDict, total=False):
    """End latched stops. It never moves the robot: a new command must follow."""
    latch: Latch | None
    """Only this one; `None` = all. Those whose cause is still there are refused."""


class _BodyAssignAlways(TypedDict):
    assignment: Assignment
    """Which."""
    errand: Errand
    """What to do."""


class BodyAssign(_BodyAssignAlways, total=False):
    """Drive under an assignment of the dispatcher; the goal's id is the assignment's. A lower
    one is refused, an equal one acknowledged again, a higher one replaces the goal; but the
    next leg of the one under way waits for it (capability [`NEXT_LEG`](super::NEXT_LEG)): the
    point between is passed."""
    finish_s: float
    """See [`Body::Goto`]."""
    on_link_loss: LinkLoss
    """When the client falls silent."""


class BodyWithdraw(TypedDict):
    """End this assignment, and let it never begin: no drive of it or of an earlier one counts
    any more. It needs no lease, as it only ever ends what the same client began."""
    assign_seq: int
    """Number of the assignment."""
    ledger: int
    """The ledger."""


class Body(TypedDict, total=False):
    """What is asked of a robot."""
    acquire: BodyAcquire
    """Ask for the lease."""
    retain: dict[str, Any]
    """Keep it; each 100 ms."""
    release: dict[str, Any]
    """Give it back."""
    goto: BodyGoto
    """Drive to a point of the map."""
    wander: BodyWander
    """Wander (§4.6)."""
    stop: dict[str, Any]
    """Drop the goal, stand; anyone may."""
    cancel: BodyCancel
    """End this goal if it is the one that runs."""
    set_pose: BodySetPose
    """Tell the robot where it stands in the map; refused while a goal runs."""
    reset: BodyReset
    """End latched stops. It never moves the robot: a new command must follow."""
    assign: BodyAssign
    """Drive under an assignment of the dispatcher; the goal's id is the assignment's. A lower
    one is refused, an equal one acknowledged again, a higher one replaces the goal; but the
    next leg of the one under way waits for it (capability [`NEXT_LEG`](super::NEXT_LEG)): the
    point between is passed."""
    withdraw: BodyWithdraw
    """End this assignment, and let it never begin: no drive of it or of an earlier one counts
    any more. It needs no lease, as it only ever ends what the same client began."""


class DispatchBodySubmit(TypedDict):
    """Take these, all or none."""
    tasks: list[TaskSpecInput]
    """1 to [`MAX_SUBMISSION`]."""


class DispatchBodyCancel(TypedDict):
    """End them; the answer comes when their robots have confirmed."""
    tasks: list[TaskId]
    """Which."""


class DispatchBodyPause(TypedDict):
    """Put them aside; their robots stop."""
    tasks: list[TaskId]
    """Which."""


class DispatchBodyResume(TypedDict):
    """Let go on what is paused or held."""
    tasks: list[TaskId]
    """Which."""


class DispatchBodyRetry(TypedDict):
    """Queue again what has failed or was cancelled, from where it was."""
    tasks: list[TaskId]
    """Which."""


class DispatchBodyShow(TypedDict):
    """One task with its history."""
    task: TaskId
    """Which."""


class DispatchBodyExtend(TypedDict):
    """More points for a route that has not ended. The same again changes nothing."""
    after: int
    """Points that it has without these. If it has others than the client believes, the request
    is refused as [`DispatchCode::Stale`]."""
    points: list[WaypointInput]
    """What follows them; 1 to [`MAX_POINTS`] altogether."""
    task: TaskId
    """Which."""


class DispatchBody(TypedDict, total=False):
    """What is asked of the dispatcher."""
    submit: DispatchBodySubmit
    """Take these, all or none."""
    cancel: DispatchBodyCancel
    """End them; the answer comes when their robots have confirmed."""
    pause: DispatchBodyPause
    """Put them aside; their robots stop."""
    resume: DispatchBodyResume
    """Let go on what is paused or held."""
    retry: DispatchBodyRetry
    """Queue again what has failed or was cancelled, from where it was."""
    show: DispatchBodyShow
    """One task with its history."""
    cancel_all: dict[str, Any]
    """End all that have not ended."""
    activate: dict[str, Any]
    """Assign tasks again after an emergency stop of all robots."""
    adopt: dict[str, Any]
    """Take the tasks of other maps over to the one that the fleet has now."""
    status: dict[str, Any]
    """How the dispatcher stands, without its tasks."""
    extend: DispatchBodyExtend
    """More points for a route that has not ended. The same again changes nothing."""


class DispatchRequest(TypedDict):
    """One question to the dispatcher. The same id again, from the same client, submits nothing
    twice."""
    body: DispatchBody
    """What is asked."""
    id: str
    """Chosen by the client."""


class _ErrandGotoAlways(TypedDict):
    x_m: float
    """East, in m."""
    y_m: float
    """North, in m."""


class ErrandGoto(_ErrandGotoAlways, total=False):
    """As the request `goto`."""
    via: Via | None
    """How; `None` = planned as soon as the robot has a map, else direct."""
    yaw_rad: float | None
    """Yaw on arrival, counter-clockwise from +x."""


class ErrandWander(TypedDict):
    """As the request `wander`."""
    for_s: float
    """How long, in s."""


class Errand(TypedDict, total=False):
    """What an assigned robot does."""
    goto: ErrandGoto
    """As the request `goto`."""
    wander: ErrandWander
    """As the request `wander`."""


class Estop(TypedDict):
    """An emergency stop, put or asked: latched, whoever sends it. It needs no lease."""
    id: str
    """The same in each repetition: after a reset, a repetition that was held up does not latch
    again."""


class _RequestAlways(TypedDict):
    body: Body
    """What is asked."""
    id: str
    """Chosen by the client; a goal's id is its request's."""


class Request(_RequestAlways, total=False):
    """One question to a robot. The same id again gets the same answer and does nothing
    twice."""
    lease: Lease | None
    """The client's lease, if it holds one."""


class _SetpointAlways(TypedDict):
    rpm: float
    """Wheel speed, + = ahead."""
    steering: float
    """−1..=1, + = right."""


class Setpoint(_SetpointAlways, total=False):
    """A teleoperation setpoint; lives 200 ms on the robot's own clock."""
    echo_tick_ms: int | None
    """`tick_ms` of the robot as last seen in its state; at most 300 ms old, or the setpoint is
    dropped."""
    lease: Lease | None
    """The client's lease."""
    seq: int
    """Counts the client's setpoints; one that is not above the last accepted one is dropped."""


class TaskKindInputGoto(TypedDict):
    """Drive to a point."""
    to: WaypointInput
    """Where to."""


class _TaskKindInputRouteAlways(TypedDict):
    points: list[WaypointInput]
    """In this order."""


class TaskKindInputRoute(_TaskKindInputRouteAlways, total=False):
    """Drive along points."""
    dwell_s: float
    """How long to stand at each, in s."""
    loops: int
    """How often."""


class _TaskKindInputPatrolAlways(TypedDict):
    points: list[WaypointInput]
    """In this order."""


class TaskKindInputPatrol(_TaskKindInputPatrolAlways, total=False):
    """Drive along points again and again."""
    dwell_s: float
    """How long to stand at each, in s."""
    for_s: float | None
    """How long altogether, in s; `None` = until cancelled."""


class TaskKindInputWander(TypedDict):
    """Wander."""
    for_s: float
    """How long, in s."""


class TaskKindInput(TypedDict, total=False):
    """What is to be done."""
    goto: TaskKindInputGoto
    """Drive to a point."""
    route: TaskKindInputRoute
    """Drive along points."""
    patrol: TaskKindInputPatrol
    """Drive along points again and again."""
    wander: TaskKindInputWander
    """Wander."""


class _TaskSpecInputAlways(TypedDict):
    kind: TaskKindInput
    """What is to be done."""


class TaskSpecInput(_TaskSpecInputAlways, total=False):
    """A task as it is submitted."""
    deadline_ms: int | None
    """When it must be done, in ms since 1970; else it has failed."""
    finish_s: float
    """How long one drive may take with [`LinkLoss::Finish`], in s."""
    grace_s: float
    """How long it waits for a robot that is gone or taken, in s."""
    on_link_loss: LinkLoss
    """What its robot does when it does not hear the dispatcher."""
    on_takeover: OnTakeover
    """When somebody else takes its robot."""
    priority: int
    """0 = when nothing else is to be done, 9 = first."""
    retries: int
    """How often it is begun anew after it has failed on a robot."""
    who: Who
    """Who may do it."""


class _WaypointInputAlways(TypedDict):
    x_m: float
    """East, in m."""
    y_m: float
    """North, in m."""


class WaypointInput(_WaypointInputAlways, total=False):
    """A place to drive to."""
    yaw_rad: float | None
    """Yaw on arrival, counter-clockwise from +x; `None` = any."""
