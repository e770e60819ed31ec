//! Problems as the interface documents them: what any address may answer, and what those of one kind of thing may.

use utoipa::IntoResponses;

use super::problem::ProblemDocument;

/// What any address may answer instead.
#[derive(IntoResponses)]
#[allow(dead_code)] // says what is answered
pub enum Problems {
    #[response(
        status = "default",
        description = "A problem",
        content_type = "application/problem+json"
    )]
    Any(ProblemDocument),
}

/// What the address of a paint may answer instead.
#[derive(IntoResponses)]
#[allow(dead_code)] // says what is answered
pub enum PaintProblems {
    #[response(
        status = 404,
        description = "There is no such paint",
        content_type = "application/problem+json"
    )]
    Unknown(ProblemDocument),
    #[response(
        status = "default",
        description = "A problem",
        content_type = "application/problem+json"
    )]
    Any(ProblemDocument),
}

/// What the address of a blend may answer instead.
#[derive(IntoResponses)]
#[allow(dead_code)] // says what is answered
pub enum BlendProblems {
    #[response(
        status = 404,
        description = "There is no such blend",
        content_type = "application/problem+json"
    )]
    Unknown(ProblemDocument),
    #[response(
        status = "default",
        description = "A problem",
        content_type = "application/problem+json"
    )]
    Any(ProblemDocument),
}

/// What the address of an environment may answer instead.
#[derive(IntoResponses)]
#[allow(dead_code)] // says what is answered
pub enum EnvironmentProblems {
    #[response(
        status = 404,
        description = "There is no such environment",
        content_type = "application/problem+json"
    )]
    Unknown(ProblemDocument),
    #[response(
        status = "default",
        description = "A problem",
        content_type = "application/problem+json"
    )]
    Any(ProblemDocument),
}

/// What the address of a job may answer instead.
#[derive(IntoResponses)]
#[allow(dead_code)] // says what is answered
pub enum JobProblems {
    #[response(
        status = 404,
        description = "There is no such job",
        content_type = "application/problem+json"
    )]
    Unknown(ProblemDocument),
    #[response(
        status = "default",
        description = "A problem",
        content_type = "application/problem+json"
    )]
    Any(ProblemDocument),
}
