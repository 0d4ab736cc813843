//! Alerts and history: what needs a person, and what happened.

use super::{ANSWERS_WITHIN, DispatcherClient, not_ours};
use crate::client::get;
use crate::error::{Error, ErrorKind, Result};
use std::time::Duration;
use xtb_bus::Incoming;
use xtb_identity::Action;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{AckReply, AckRequest, FleetAlerts, HistoryReply, HistoryRequest, Message};

impl DispatcherClient<'_> {
    /// All alerts that the dispatcher keeps.
    ///
    /// # Errors
    /// [`ErrorKind::NoDispatcher`], or [`ErrorKind::OutcomeUnknown`] if it does not answer.
    pub async fn alerts(&self) -> Result<FleetAlerts> {
        let key = self.client.keys().dispatch_alerts();
        let answers = get(self.client.bus(), &key, self.within(ANSWERS_WITHIN)).await?;
        self.first(answers, "no request was sent").await
    }

    /// Says that a person has seen alerts. The same again changes nothing.
    ///
    /// # Errors
    /// As [`Self::alerts`]; [`ErrorKind::NotAllowed`]; [`ErrorKind::Invalid`]: too many at once.
    pub async fn acknowledge(&self, request: &AckRequest) -> Result<AckReply> {
        self.client.may(Action::ChangeTasks)?;
        let name = self.client.name();
        let (key, channel) =
            (self.client.keys().dispatch_ack(Some(name)), Channel::DispatchAck(name.clone()));
        self.ask_one(&key, &channel, request, "nothing was acknowledged").await
    }

    /// Asks the history.
    ///
    /// # Errors
    /// As [`Self::alerts`]; [`ErrorKind::Failed`]: it cannot be read.
    pub async fn history(&self, request: &HistoryRequest) -> Result<HistoryReply> {
        let (key, channel) = (self.client.keys().dispatch_history(), Channel::DispatchHistory);
        match self.ask_one(&key, &channel, request, "no request was sent").await? {
            HistoryReply::Failed { message } => Err(Error::new(ErrorKind::Failed, message)
                .hint("the log of the dispatcher says more; tasks and alerts do not depend on the history")),
            reply => Ok(reply),
        }
    }

    async fn ask_one<Q: Message, A: Message>(
        &self,
        key: &str,
        channel: &Channel,
        request: &Q,
        left_undone: &str,
    ) -> Result<A> {
        request.validate().map_err(|error| Error::new(ErrorKind::Invalid, error.to_string()))?;
        let mut answers = Vec::new();
        let each = |answer: Incoming| answers.push(answer);
        self.client.bus().ask_each(key, channel, request, self.within(ANSWERS_WITHIN), each).await?;
        self.first(answers, left_undone).await
    }

    async fn first<A: Message>(&self, answers: Vec<Incoming>, left_undone: &str) -> Result<A> {
        match answers.first() {
            Some(answer) => answer.decode().map_err(|error| not_ours(&error.to_string())),
            None => {
                let error = self.silent(Duration::ZERO, left_undone, self.is_there().await);
                Err(self.client.explained(error).await)
            }
        }
    }
}
