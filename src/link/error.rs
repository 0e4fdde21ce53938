//! Why a link cannot be opened or used.

use skyloop_firmware_sim::address::Address;
use skyloop_firmware_sim::port::{PortError, Refusal};
use std::io;
use thiserror::Error;

/// Why a link cannot be opened or used.
#[derive(Debug, Error)]
pub enum LinkError {
    /// Invalid URL.
    #[error("link {url:?}: {reason}; write for example {examples}")]
    Url {
        /// As given.
        url: String,
        /// The problem.
        reason: String,
        /// Correct URLs.
        examples: String,
    },
    /// The system refused to open it.
    #[error("link {url}: {source}")]
    Refused {
        /// As given.
        url: String,
        /// Attempted action, system error and remedy.
        source: Refusal,
    },
    /// The threads of the link have ended.
    #[error("link {0}: it has closed; open it again")]
    Closed(String),
}

/// Why a link cannot be opened from an address.
pub type OpenError = skyloop_firmware_sim::address::OpenError<LinkError>;

impl From<LinkError> for OpenError {
    fn from(error: LinkError) -> OpenError {
        OpenError::Failed(error)
    }
}

impl LinkError {
    /// The system refuses `action` for the link at `url`.
    pub(super) fn refused(
        url: String,
        action: &'static str,
        source: io::Error,
        remedy: &str,
    ) -> LinkError {
        let remedy = remedy.to_string();
        let source = Refusal {
            action,
            source,
            remedy,
        };
        LinkError::Refused { url, source }
    }

    /// The client's end of the loopback at `url` cannot be opened.
    pub(super) fn no_client(url: &Address, error: PortError) -> LinkError {
        let error = io::Error::other(error);
        LinkError::refused(
            url.text.clone(),
            "open the client's end",
            error,
            "try again",
        )
    }
}
