//! What a master control sends.

use super::Vehicle;
use crate::action::{ActionState, Status, Wish, make_room};
use crate::incoming::{self, Action, Node, Order};
use crate::operating::Operating;
use crate::order::{Relation, START_RADIUS_M};
use crate::problem::{Problem, ProblemKind};

impl Vehicle {
    /// The bytes of a message on `order`.
    pub fn order(&mut self, bytes: &[u8]) {
        if let Err(problem) =
            incoming::order(self.serial.protocol, bytes).and_then(|order| self.consider(order))
        {
            self.refuse(problem);
        }
    }

    fn consider(&mut self, order: Order) -> Result<(), Problem> {
        let about = |problem: Problem| {
            let problem = problem.with("orderId", &order.order_id);
            problem.with("orderUpdateId", order.order_update_id).with("topic", "order")
        };
        self.check_header(order.manufacturer.as_deref(), order.serial_number.as_deref()).map_err(about)?;
        if let Some(pending) = &self.record.pending {
            if *pending == order {
                return Ok(());
            }
            let text = format!("the order {} is being accepted", pending.order_id);
            return Err(about(Problem::new(ProblemKind::OtherOrderActive, text)));
        }
        let relation = self.record.order.relation(&order, self.serial.protocol.is_v3())?;
        if relation == Relation::Repeated {
            return Ok(());
        }
        if order.nodes.iter().any(|node| !node.actions.is_empty())
            || order.edges.iter().any(|edge| !edge.actions.is_empty())
        {
            let kind = ProblemKind::UnsupportedAction;
            return Err(about(Problem::new(kind, "actions of nodes and edges are not supported")));
        }
        self.check_nodes(&order).map_err(about)?;
        if relation == Relation::New {
            self.check_start(&order.nodes[0]).map_err(about)?;
        }
        self.record.pending = Some(order);
        self.may_be_taken = false;
        Ok(())
    }

    fn check_header(&self, manufacturer: Option<&str>, serial: Option<&str>) -> Result<(), Problem> {
        for (key, said, ours) in [
            ("manufacturer", manufacturer, self.serial.manufacturer.as_str()),
            ("serialNumber", serial, self.serial.robot.as_str()),
        ] {
            if let Some(said) = said.filter(|said| *said != ours) {
                let text = format!("{key} is not {ours}");
                return Err(Problem::new(ProblemKind::Foreign, text).with(key, said));
            }
        }
        Ok(())
    }

    /// Every node but the first has a place, on the robot's map.
    fn check_nodes(&self, order: &Order) -> Result<(), Problem> {
        let map = self.robot.as_ref().and_then(|robot| robot.nav.map.as_ref()).map(|map| map.name.as_str());
        for (i, node) in order.nodes.iter().enumerate() {
            let Some(position) = &node.node_position else {
                if i == 0 {
                    continue;
                }
                let problem = Problem::new(ProblemKind::NoRoute, "a node without nodePosition");
                return Err(problem.with("nodeId", &node.node_id));
            };
            if map != Some(position.map_id.as_str()) {
                let text = match map {
                    Some(map) => format!("the map is {map}"),
                    None => "the robot has no map".to_owned(),
                };
                let problem = Problem::new(ProblemKind::UnknownMap, text);
                return Err(problem.with("nodeId", &node.node_id).with("mapId", &position.map_id));
            }
        }
        Ok(())
    }

    /// Whether the robot may begin, at the first node of a new order.
    fn check_start(&self, first: &Node) -> Result<(), Problem> {
        let not_available = |text: &str| Err(Problem::new(ProblemKind::NotAvailable, text));
        let Some(robot) = self.robot.as_ref().filter(|_| self.present) else {
            return not_available("the robot is not connected");
        };
        if !Operating::of(robot, false).takes_orders() {
            return not_available("the robot is driven by somebody else, or is starting");
        }
        let far = |text: String| {
            let problem = Problem::new(ProblemKind::StartOutOfRange, text);
            Err(problem.with("nodeId", &first.node_id))
        };
        let Some(position) = &first.node_position else {
            let is_there = self.record.order.last_node.0 == first.node_id;
            return if is_there { Ok(()) } else { far("the first node has no nodePosition".to_owned()) };
        };
        let distance_m = (position.x - robot.pose.x_m).hypot(position.y - robot.pose.y_m);
        let radius_m = position.radius_m().max(START_RADIUS_M);
        if distance_m > radius_m {
            return far(format!("the first node is {distance_m:.2} m away, its radius is {radius_m:.2} m"));
        }
        Ok(())
    }

    /// The bytes of a message on `instantActions`.
    pub fn instant_actions(&mut self, bytes: &[u8]) {
        let read = incoming::instant_actions(bytes).and_then(|read| {
            self.check_header(read.manufacturer.as_deref(), read.serial_number.as_deref())
                .map_err(|problem| problem.with("topic", "instantActions"))?;
            Ok(read.actions)
        });
        match read {
            Ok(actions) => actions.iter().for_each(|action| self.act(action)),
            Err(problem) => self.refuse(problem),
        }
    }

    fn act(&mut self, action: &Action) {
        let (id, kind) = (&action.action_id, &action.action_type);
        // One that is under way was sent again. One that has ended is done again: ids should not be used twice, and
        // some masters do; a cancellation must not be taken for an old one.
        if self.record.actions.iter().any(|known| known.id == *id && !known.status.is_final()) {
            return;
        }
        self.record.actions.retain(|known| known.id != *id);
        let wish = Wish::of(action);
        let begun = wish.clone().map_err(|text| (ProblemKind::InvalidInstantAction, text));
        let begun = begun.and_then(|wish| self.begin(&wish, action));
        if !make_room(&mut self.record.actions) {
            let problem =
                Problem::new(ProblemKind::InvalidInstantAction, "too many instant actions are under way");
            return self.refuse(problem.with("actionId", id));
        }
        let mut state = ActionState {
            id: id.clone(),
            kind: kind.clone(),
            status: Status::Running,
            result: None,
            wish: wish.ok(),
        };
        if let Err((problem, text)) = begun {
            state.end(Err(text.clone()));
            let problem = Problem::new(problem, text).with("actionId", id).with("actionType", kind);
            self.refuse(problem.with("topic", "instantActions"));
        }
        self.record.actions.push(state);
    }

    /// What changes at once by an instant action; the rest follows in `settle` and `next_ask`.
    fn begin(&mut self, wish: &Wish, action: &Action) -> Result<(), (ProblemKind, String)> {
        let invalid = |text: &str| Err((ProblemKind::InvalidInstantAction, text.to_owned()));
        let has_order = !self.record.order.is_finished() || self.record.pending.is_some();
        match wish {
            Wish::Cancel => {
                let named = action.parameter("orderId").and_then(serde_json::Value::as_str);
                let pending = self.record.pending.as_ref().map(|order| order.order_id.as_str());
                let known = [Some(self.record.order.id.as_str()), pending];
                if !has_order || named.is_some_and(|named| !known.contains(&Some(named))) {
                    return Err((ProblemKind::NoOrderToCancel, "there is no such order".to_owned()));
                }
            }
            Wish::Pause => self.record.paused = true,
            Wish::Unpause => self.record.paused = false,
            Wish::State => self.published.want_state(),
            Wish::Factsheet => self.published.want_factsheet(),
            Wish::Clear => self.record.actions.retain(|known| !known.status.is_final()),
            Wish::Pose { map_id, .. } => {
                let map = self.robot.as_ref().and_then(|robot| robot.nav.map.as_ref());
                if has_order {
                    return invalid("the robot has an order");
                }
                if map.is_some_and(|map| map.name != *map_id) {
                    return invalid("the fleet has another map");
                }
            }
        }
        Ok(())
    }
}
