//! A dispatcher that a test plays in the client's own session: it says what it was told to say.

use crate::client::Client;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::mpsc;
use xtb_bus::{PresenceToken, Question, Service};
use xtb_protocol::codec::Format;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{
    DispatchBody, DispatchOutcome, DispatchReply, DispatchRequest, Suspension, TaskHistory, TaskId, TaskList,
    TaskView,
};

/// What it knows, and what it was asked.
#[derive(Debug, Default)]
pub struct FakeDispatcherState {
    /// Answers to commands in their order; `None` = silence. `show` is answered from `tasks`.
    pub answers: VecDeque<Option<DispatchOutcome>>,
    pub tasks: Vec<TaskView>,
    pub suspended: Vec<Suspension>,
    /// Tasks of a page at most.
    pub page: Option<usize>,
    pub asked: Vec<DispatchRequest>,
}

/// The dispatcher, for as long as it is held.
pub struct FakeDispatcher {
    pub told: Arc<Mutex<FakeDispatcherState>>,
    _services: Vec<Service>,
    answering: tokio::task::JoinHandle<()>,
    _alive: PresenceToken,
}

impl FakeDispatcher {
    pub async fn start(client: &Client, told: FakeDispatcherState) -> Self {
        let (bus, keys) = (client.bus(), client.keys().clone());
        let told = Arc::new(Mutex::new(told));
        let (sender, mut questions) = mpsc::unbounded_channel::<Question>();
        let mut _services = Vec::new();
        for key in [keys.dispatch_cmd(None), keys.dispatch_tasks()] {
            let sender = sender.clone();
            _services.push(
                bus.serve(&key, move |question| sender.send(question).unwrap_or_default()).await.unwrap(),
            );
        }
        let (knows, me) = (Arc::clone(&told), client.name().clone());
        let answering = tokio::spawn(async move {
            while let Some(question) = questions.recv().await {
                if question.key().channel == Channel::DispatchTasks {
                    let list = knows.lock().unwrap().list(question.parameter("after"));
                    question.reply(&keys.dispatch_tasks(), &list, Format::Postcard).await.unwrap();
                    continue;
                }
                let (request, format) = question.decode::<DispatchRequest>().unwrap();
                let result = knows.lock().unwrap().answer(&request);
                if let Some(result) = result {
                    let suspended = knows.lock().unwrap().suspended.clone();
                    let reply = DispatchReply { id: request.id, result, left_out: 0, suspended };
                    question.reply(&keys.dispatch_cmd(Some(&me)), &reply, format).await.unwrap();
                }
            }
        });
        let _alive = bus.declare_alive(&client.keys().dispatch_alive()).await.unwrap();
        Self { told, _services, answering, _alive }
    }

    /// Once what a test waits for is so.
    pub async fn until(&self, so: impl Fn(&FakeDispatcherState) -> bool) {
        let mut look = tokio::time::interval(Duration::from_millis(5));
        while !so(&self.told.lock().unwrap()) {
            look.tick().await;
        }
    }
}

impl FakeDispatcherState {
    /// A page of them.
    fn list(&self, after: Option<&str>) -> TaskList {
        let after = after.map_or(0, |after| after.parse::<TaskId>().unwrap().number());
        let following = || self.tasks.iter().filter(|task| task.id.number() > after);
        let tasks: Vec<_> = following().take(self.page.unwrap_or(usize::MAX)).cloned().collect();
        let left_out = (following().count() - tasks.len()) as u64;
        let suspended = self.suspended.clone();
        TaskList { ledger: 1, at_ms: 5000, ledger_failed: None, tasks, left_out, suspended }
    }

    fn answer(&mut self, request: &DispatchRequest) -> Option<DispatchOutcome> {
        self.asked.push(request.clone());
        if let DispatchBody::Show { task } = &request.body {
            let task = self.tasks.iter().find(|known| known.id == *task)?.clone();
            return Some(DispatchOutcome::Shown(Box::new(TaskHistory {
                task,
                steps: Vec::new(),
                left_out: 0,
            })));
        }
        self.answers.pop_front().flatten()
    }
}

impl Drop for FakeDispatcher {
    fn drop(&mut self) {
        self.answering.abort();
    }
}
