// The master control of vda-5050-lib (npm, VDA 5050 2.0.0) drives a robot: node vda_5050_lib.js BROKER MANUFACTURER SERIAL
// Prints a line of JSON for each step; the last one is {"ok": true}.
"use strict";
const assert = require("node:assert");
const { MasterController, Topic, BlockingType } = require("vda-5050-lib");

const [brokerUrl, manufacturer, serialNumber] = process.argv.slice(2);
const agv = { manufacturer, serialNumber };
const master = new MasterController(
  { interfaceName: "uagv", transport: { brokerUrl }, vdaVersion: "2.0.0" }, { targetAgvs: agv });
const say = (step, more) => console.log(JSON.stringify({ step, ...more }));
const later = (what, promise) => Promise.race([promise,
  new Promise((_, reject) => setTimeout(() => reject(new Error(`waited in vain for ${what}`)), 60000).unref())]);

let state, watchers = [];
const until = (what, is) => later(what, new Promise(resolve => {
  const look = () => { if (state && is(state)) { watchers = watchers.filter(other => other !== look); resolve(state); } };
  watchers.push(look);
  look();
}));

let mapId;
const node = (name, sequenceId, [x, y], released = true) =>
  ({ nodeId: name, sequenceId, released, nodePosition: { x, y, mapId, allowedDeviationXY: 0.5 }, actions: [] });
const edge = (start, end, sequenceId, released = true) =>
  ({ edgeId: `${start}-${end}`, sequenceId, released, startNodeId: start, endNodeId: end, actions: [] });
const errorTypes = state => state.errors.map(error => error.errorType);

async function traversed() {
  const order = {
    orderId: "traversed", orderUpdateId: 0,
    nodes: [node("a", 0, [0, 0]), node("b", 2, [0, 1.2]), node("c", 4, [0, 2.4]), node("d", 6, [0, 3.4], false)],
    edges: [edge("a", "b", 1), edge("b", "c", 3), edge("c", "d", 5, false)],
  };
  const update = {
    orderId: "traversed", orderUpdateId: 1,
    nodes: [node("c", 4, [0, 2.4]), node("d", 6, [0, 3.4])], edges: [edge("c", "d", 5)],
  };
  const seen = [], stops = {};
  let stoodSince, updated;
  const watch = ({ driving, lastNodeId, agvPosition: { x, y } }) => {
    // How long the robot stands, by the states, since it traversed each node: not where it creeps up to the last one.
    const stands = !driving && Math.hypot(x, y - 3.4) > 0.2;
    if (stands && stoodSince === undefined) stoodSince = Date.now();
    if (!stands && stoodSince !== undefined) {
      stops[lastNodeId] = (stops[lastNodeId] || 0) + Date.now() - stoodSince;
      stoodSince = undefined;
    }
  };
  watchers.push(() => watch(state));
  await later("the order", new Promise((resolve, reject) => {
    const events = {
      onOrderProcessed: (withError, byCancelation, active) => {
        if (withError) return reject(new Error(JSON.stringify(withError)));
        seen.push(active ? "base driven" : "processed");
        if (!active) resolve();
      },
      onNodeTraversed: node => {
        seen.push(node.nodeId);
        if (node.nodeId === "b" && !updated) updated = master.assignOrder(agv, update, events); // it is under way to c
      },
      onEdgeTraversed: edge => seen.push(edge.edgeId),
    };
    master.assignOrder(agv, order, events).catch(reject);
  }));
  assert.deepStrictEqual(seen, ["a", "a-b", "b", "b-c", "c", "c-d", "d", "processed"]);
  assert.strictEqual(state.orderUpdateId, 1);
  assert.deepStrictEqual([state.nodeStates, state.edgeStates], [[], []]);
  // It passes the nodes, the former end of its base too; for a moment it may stand where a busy computer plans too late.
  assert.ok((stops.b || 0) + (stops.c || 0) < 500, JSON.stringify(stops));
  say("traversed", { seen, stops_ms: stops });
}

async function cancelled() {
  const order = {
    orderId: "cancelled", orderUpdateId: 0,
    nodes: [node("d", 0, [0, 3.4]), node("e", 2, [0, 0.2])], edges: [edge("d", "e", 1)],
  };
  const ended = new Promise((resolve, reject) => {
    const onOrderProcessed = (withError, byCancelation) => withError ? reject(withError) : resolve(byCancelation);
    master.assignOrder(agv, order, { onOrderProcessed }).catch(reject);
  });
  await until("driving", state => state.orderId === "cancelled" && state.driving);
  const statuses = [];
  await later("the cancellation", new Promise((resolve, reject) => {
    const action = { actionId: "cancel", actionType: "cancelOrder", blockingType: BlockingType.None };
    const onActionStateChanged = ({ actionStatus }) => {
      statuses.push(actionStatus);
      if (actionStatus === "FINISHED") resolve();
    };
    const onActionError = error => reject(new Error(JSON.stringify(error)));
    master.initiateInstantActions(agv, { instantActions: [action] }, { onActionStateChanged, onActionError });
  }));
  assert.strictEqual(await later("the end", ended), true, "by cancelation");
  assert.strictEqual(state.driving, false);
  say("cancelled", { statuses });
}

async function refused() {
  const at = [state.agvPosition.x, state.agvPosition.y];
  const order = (orderId, orderUpdateId, more = {}) => ({
    orderId, orderUpdateId,
    nodes: [node("p", 0, at), node("q", 2, [at[0], at[1] + 0.4]), node("r", 4, [0, 0], false)],
    edges: [edge("p", "q", 1), edge("q", "r", 3, false)], ...more,
  });
  const send = order => master.publish(Topic.Order, agv, order);
  const clean = () => until("no error", state => state.errors.length === 0);
  await send(order("refused", 3));
  await until("accepted", state => state.orderId === "refused" && state.orderUpdateId === 3);
  await clean();
  await send(order("refused", 3)); // the same again: nothing
  await send(order("refused", 2));
  await until("stale", state => errorTypes(state).includes("orderUpdateError"));
  await send(order("other", 0));
  await until("other", state => errorTypes(state).includes("orderError"));
  await send(order("refused", 4, { nodes: [node("q", 2, at), node("s", 4, [50, 50])], edges: [edge("q", "s", 3)] }));
  await until("a wall", state => errorTypes(state).includes("noRouteError"));
  // The library sends nothing malformed by itself: over its connection all the same.
  const topic = `uagv/v2/${manufacturer}/${serialNumber}/order`;
  await new Promise((resolve, reject) => master["_mqtt"].publish(topic, '{"orderId": 7}', error => error ? reject(error) : resolve()));
  await until("malformed", state => errorTypes(state).includes("validationError"));
  assert.deepStrictEqual([state.orderId, state.orderUpdateId], ["refused", 3], "the order goes on");
  say("refused", { errors: errorTypes(state) });
}

async function main() {
  await master.start();
  await master.subscribe(Topic.State, agv, next => {
    state = next;
    [...watchers].forEach(watcher => watcher());
  });
  await until("a robot at its start", state => state.agvPosition && state.agvPosition.positionInitialized);
  mapId = state.agvPosition.mapId;
  await traversed();
  await cancelled();
  await refused();
  await master.stop();
  console.log(JSON.stringify({ ok: true }));
}

main().then(() => process.exit(0), error => {
  console.log(JSON.stringify({ ok: false, error: String(error.stack || error), state }));
  process.exit(1);
});
