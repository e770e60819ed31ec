//! Panoramas as pictures are lit with them: read once, kept in memory as long as there is room.

use std::fmt;

use serde::{Serialize, Serializer};

use super::app::App;
use super::http::{Kind, Problem};
use super::ids;
use crate::store::{EnvironmentRecord, Hash};
use crate::workshop::{Environment, EnvironmentError};

/// What ids of panoramas begin with.
pub const PREFIX: &str = "e_";

/// A panorama with its address, by which it is told apart: the id is that of its bytes.
#[derive(Clone)]
pub struct Surroundings {
    /// Address.
    pub id: String,
    /// Light by direction.
    pub environment: Environment,
}

impl fmt::Debug for Surroundings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.id)
    }
}

impl PartialEq for Surroundings {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

impl Serialize for Surroundings {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.id.serialize(serializer)
    }
}

impl Surroundings {
    /// Bytes in memory, about.
    #[must_use]
    pub fn weight(&self) -> u32 {
        let [width, height] = self.environment.size().unwrap_or_default();
        // Three numbers of 4 bytes a pixel.
        u32::try_from(width * height * 12 + 1024).unwrap_or(u32::MAX)
    }
}

impl App {
    /// What is on record of a panorama.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownEnvironment`] when there is none.
    pub async fn environment(&self, id: &str) -> Result<EnvironmentRecord, Problem> {
        let record = self.catalogue.environment(id).await?;
        record.ok_or_else(|| unknown_environment(id))
    }

    /// The light of a panorama; `None` when there is none of this id.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails, or too many wait for a processor.
    pub async fn surroundings(&self, id: &str) -> Result<Option<Surroundings>, Problem> {
        if !ids::is(PREFIX, id) {
            return Ok(None);
        }
        let read = async { self.read_surroundings(id).await.map_err(Some)?.ok_or(None) };
        let found = match self.panoramas.try_get_with_by_ref(id, read).await {
            Ok(found) => found,
            Err(problem) => return (*problem).clone().map_or(Ok(None), Err),
        };
        // What was deleted while it was read does not stay.
        if self.catalogue.environment(id).await?.is_none() {
            self.panoramas.invalidate(id).await;
            return Ok(None);
        }
        Ok(Some(found))
    }

    async fn read_surroundings(&self, id: &str) -> Result<Option<Surroundings>, Problem> {
        let Some(record) = self.catalogue.environment(id).await? else {
            return Ok(None);
        };
        match self.panorama_of(record.file).await? {
            Some(read) => Ok(Some(Surroundings {
                id: record.id,
                environment: read.map_err(Problem::internal)?.0,
            })),
            None if self.catalogue.environment(id).await?.is_none() => Ok(None),
            None => Err(Problem::internal(format!("the file of {id} is not there"))),
        }
    }

    /// Reads a blob as a panorama, and says the ending of such a file's name; `None` when there is no such blob.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails, or too many wait for a processor.
    pub async fn panorama_of(
        &self,
        file: Hash,
    ) -> Result<Option<Result<(Environment, &'static str), EnvironmentError>>, Problem> {
        let Some(bytes) = self.blobs.read(file).await? else {
            return Ok(None);
        };
        let limits = self.config.limits;
        let read = move || {
            let ending = if bytes.starts_with(b"#?") {
                "hdr"
            } else {
                "exr"
            };
            Environment::from_bytes(&bytes, &limits).map(|environment| (environment, ending))
        };
        self.bench.run(read).await.map(Some)
    }

    /// Forgets a panorama, and its file unless something else names it.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownEnvironment`] when there is none.
    pub async fn forget_environment(&self, id: &str) -> Result<(), Problem> {
        let gone = self.catalogue.remove_environment(id).await?;
        let gone = gone.ok_or_else(|| unknown_environment(id))?;
        self.panoramas.invalidate(id).await;
        self.forget_upload(gone.file).await
    }
}

/// The problem of an id that no panorama has.
#[must_use]
pub fn unknown_environment(id: &str) -> Problem {
    let detail = format!("There is no environment {id:?}.");
    Problem::new(Kind::UnknownEnvironment, detail)
        .accepting("the id of an answer to POST /v1/environments")
}
