//! Who is linked to this session: for routers, which know by their certificates.

use crate::session::{Bus, BusError, failed};
use zenoh::sample::SampleKind;

/// One end of a link.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Link {
    /// The common name of the other side's certificate; `None` = it showed none.
    pub common_name: Option<String>,
    /// From where it comes, such as `tls/10.0.0.7:51234`.
    pub from: String,
}

/// Watches links until it is dropped.
pub struct Links {
    _inner: Box<dyn std::any::Any + Send + Sync>,
}

impl Bus {
    /// Calls `each` for the links that there are, and for each that comes (`true`) or goes.
    ///
    /// # Errors
    /// [`BusError::Operation`].
    pub async fn watch_links(
        &self,
        each: impl Fn(Link, bool) + Send + Sync + 'static,
    ) -> Result<Links, BusError> {
        let inner = self
            .session
            .info()
            .link_events_listener()
            .history(true)
            .callback(move |event| {
                let link = event.link();
                let common_name = link.auth_identifier().map(str::to_owned);
                let link = Link { common_name, from: link.dst().to_string() };
                each(link, event.kind() == SampleKind::Put);
            })
            .await
            .map_err(failed("listening for links", "(session)"))?;
        Ok(Links { _inner: Box::new(inner) })
    }

    /// The links that there are now.
    pub async fn links(&self) -> Vec<Link> {
        let each = |link: zenoh::session::Link| Link {
            common_name: link.auth_identifier().map(str::to_owned),
            from: link.dst().to_string(),
        };
        self.session.info().links().await.map(each).collect()
    }
}
