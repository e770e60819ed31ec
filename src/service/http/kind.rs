//! Kinds of problems: each has one stable address, a title and a status.

use axum::http::StatusCode;

/// What kind of thing went wrong: one stable address each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The request as HTTP or JSON.
    MalformedRequest,
    /// A parameter in the address or its query.
    InvalidParameter,
    /// Nothing lives at this address.
    UnknownAddress,
    /// No paint of this id.
    UnknownPaint,
    /// No blend of this id.
    UnknownBlend,
    /// No environment of this id.
    UnknownEnvironment,
    /// No job of this id.
    UnknownJob,
    /// The paint has no measurement to give back.
    NoMeasurement,
    /// The address does not take this method.
    MethodNotAllowed,
    /// A browser sent it for a page of another address that may not.
    OtherOrigin,
    /// The body did not come in time.
    RequestTimeout,
    /// A sample paint, which would be there again at the next start.
    SamplePaint,
    /// The job has ended, it cannot be cancelled.
    JobEnded,
    /// The job that was waited for was cancelled.
    JobCancelled,
    /// The idempotency key stood with another request.
    KeyUsed,
    /// The body is too large.
    TooLarge,
    /// The body is of a kind that is not read.
    UnsupportedMediaType,
    /// A value in the body.
    InvalidValue,
    /// An upload that is no measurement, or a damaged one.
    UnusableMeasurement,
    /// An upload that is no panorama, or a damaged one.
    UnusableEnvironment,
    /// A bug, or a machine that fails us.
    Internal,
    /// More work waits than can be done soon.
    Overloaded,
    /// No room on the disk.
    StorageFull,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 23] = [
        Self::MalformedRequest,
        Self::InvalidParameter,
        Self::UnknownAddress,
        Self::UnknownPaint,
        Self::UnknownBlend,
        Self::UnknownEnvironment,
        Self::UnknownJob,
        Self::NoMeasurement,
        Self::MethodNotAllowed,
        Self::OtherOrigin,
        Self::RequestTimeout,
        Self::SamplePaint,
        Self::JobEnded,
        Self::JobCancelled,
        Self::KeyUsed,
        Self::TooLarge,
        Self::UnsupportedMediaType,
        Self::InvalidValue,
        Self::UnusableMeasurement,
        Self::UnusableEnvironment,
        Self::Internal,
        Self::Overloaded,
        Self::StorageFull,
    ];

    /// Last part of the address, title, and status.
    #[must_use]
    #[allow(clippy::too_many_lines)] // a table
    pub const fn told(self) -> (&'static str, &'static str, StatusCode) {
        match self {
            Self::MalformedRequest => (
                "malformed-request",
                "The request is not well formed",
                StatusCode::BAD_REQUEST,
            ),
            Self::InvalidParameter => (
                "invalid-parameter",
                "A parameter of the address is not accepted",
                StatusCode::BAD_REQUEST,
            ),
            Self::UnknownAddress => (
                "unknown-address",
                "There is nothing at this address",
                StatusCode::NOT_FOUND,
            ),
            Self::UnknownPaint => (
                "unknown-paint",
                "There is no such paint",
                StatusCode::NOT_FOUND,
            ),
            Self::UnknownBlend => (
                "unknown-blend",
                "There is no such blend",
                StatusCode::NOT_FOUND,
            ),
            Self::UnknownEnvironment => (
                "unknown-environment",
                "There is no such environment",
                StatusCode::NOT_FOUND,
            ),
            Self::UnknownJob => ("unknown-job", "There is no such job", StatusCode::NOT_FOUND),
            Self::NoMeasurement => (
                "no-measurement",
                "This paint has no measurement",
                StatusCode::NOT_FOUND,
            ),
            Self::MethodNotAllowed => (
                "method-not-allowed",
                "This address does not take this method",
                StatusCode::METHOD_NOT_ALLOWED,
            ),
            Self::OtherOrigin => (
                "other-origin",
                "Pages of another address may not do this",
                StatusCode::FORBIDDEN,
            ),
            Self::RequestTimeout => (
                "request-timeout",
                "The request did not come in time",
                StatusCode::REQUEST_TIMEOUT,
            ),
            Self::SamplePaint => (
                "sample-paint",
                "Sample paints are not deleted",
                StatusCode::CONFLICT,
            ),
            Self::JobEnded => ("job-ended", "The job has ended", StatusCode::CONFLICT),
            Self::JobCancelled => (
                "job-cancelled",
                "The job was cancelled",
                StatusCode::CONFLICT,
            ),
            Self::KeyUsed => (
                "idempotency-key-used",
                "This idempotency key was used for another request",
                StatusCode::UNPROCESSABLE_ENTITY,
            ),
            Self::TooLarge => (
                "too-large",
                "The request is too large",
                StatusCode::PAYLOAD_TOO_LARGE,
            ),
            Self::UnsupportedMediaType => (
                "unsupported-media-type",
                "Bodies of this type are not read",
                StatusCode::UNSUPPORTED_MEDIA_TYPE,
            ),
            Self::InvalidValue => (
                "invalid-value",
                "A value in the body is not accepted",
                StatusCode::UNPROCESSABLE_ENTITY,
            ),
            Self::UnusableMeasurement => (
                "unusable-measurement",
                "The upload cannot become a paint",
                StatusCode::UNPROCESSABLE_ENTITY,
            ),
            Self::UnusableEnvironment => (
                "unusable-environment",
                "The upload cannot light a picture",
                StatusCode::UNPROCESSABLE_ENTITY,
            ),
            Self::Internal => (
                "internal",
                "Something went wrong on our side",
                StatusCode::INTERNAL_SERVER_ERROR,
            ),
            Self::Overloaded => (
                "overloaded",
                "More work waits than can be done soon",
                StatusCode::SERVICE_UNAVAILABLE,
            ),
            Self::StorageFull => (
                "storage-full",
                "There is no room to store this",
                StatusCode::INSUFFICIENT_STORAGE,
            ),
        }
    }

    /// Stable address.
    #[must_use]
    pub fn address(self) -> String {
        format!("/problems/{}", self.told().0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_has_an_address_of_its_own_and_a_failing_status() {
        let mut addresses: Vec<String> = Kind::ALL.iter().map(|kind| kind.address()).collect();
        addresses.sort();
        addresses.dedup();
        assert_eq!(addresses.len(), Kind::ALL.len());
        assert!(Kind::ALL.iter().all(|kind| kind.told().2.as_u16() >= 400));
    }
}
