//! Environments as pictures are lit with them: read where the work is done, once for all who need one at a time, and kept
//! in memory after that while there is room.
//!
//! Who waits for a place to work at holds an id and no light. An environment that is larger than all the room is not
//! kept, but those who draw with it at a time share it.

use std::collections::{HashMap, VecDeque};
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};

use super::app::App;
use super::http::{Kind, Problem};
use super::ids;
use crate::store::{EnvironmentRecord, LocalBlob};
use crate::workshop::{Environment, EnvironmentError};

/// What ids of environments begin with.
pub const PREFIX: &str = "e_";

/// Name of the built-in environment.
pub const STUDIO: &str = "studio";

/// Environments in memory.
#[derive(Debug)]
pub struct Environments {
    most_bytes: usize,
    held: Mutex<Held>,
}

#[derive(Debug, Default)]
struct Held {
    /// Those in use. Who reads one holds its lock: who comes meanwhile waits and shares it.
    in_use: HashMap<String, Arc<Mutex<Weak<Environment>>>>,
    /// Those that are kept, the last used at the end.
    kept: VecDeque<(String, Arc<Environment>)>,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Environments {
    /// None yet, and room for so many bytes of them.
    #[must_use]
    pub fn new(most_bytes: u64) -> Self {
        Self {
            most_bytes: usize::try_from(most_bytes).unwrap_or(usize::MAX),
            held: Mutex::default(),
        }
    }

    /// The environment of this id: one in memory, or read now. Blocks.
    ///
    /// # Errors
    ///
    /// What `read` says.
    pub fn get_or_read<E>(
        &self,
        id: &str,
        read: impl FnOnce() -> Result<Environment, E>,
    ) -> Result<Arc<Environment>, E> {
        let place = {
            let mut held = lock(&self.held);
            held.in_use
                .retain(|_, place| Arc::strong_count(place) > 1 || lock(place).strong_count() > 0);
            Arc::clone(held.in_use.entry(id.to_owned()).or_default())
        };
        let mut place = lock(&place);
        let environment = if let Some(shared) = place.upgrade() {
            shared
        } else {
            let read = Arc::new(read()?);
            *place = Arc::downgrade(&read);
            read
        };
        drop(place);
        self.keep(id, &environment);
        Ok(environment)
    }

    fn keep(&self, id: &str, environment: &Arc<Environment>) {
        let mut held = lock(&self.held);
        held.kept.retain(|(kept, _)| kept != id);
        if environment.bytes() > self.most_bytes {
            return;
        }
        held.kept
            .push_back((id.to_owned(), Arc::clone(environment)));
        let mut bytes: usize = held.kept.iter().map(|(_, of)| of.bytes()).sum();
        while bytes > self.most_bytes {
            let Some((_, oldest)) = held.kept.pop_front() else {
                return;
            };
            bytes -= oldest.bytes();
        }
    }

    /// Keeps an environment no longer; who uses it goes on.
    pub fn forget(&self, id: &str) {
        let mut held = lock(&self.held);
        held.kept.retain(|(kept, _)| kept != id);
    }
}

/// An environment that something is to be lit with, still to be read.
#[derive(Debug)]
pub struct Unread {
    app: App,
    id: String,
    file: LocalBlob,
}

impl Unread {
    /// Reads it where the work is done. Blocks.
    ///
    /// # Errors
    ///
    /// [`Problem`] for one that was deleted a moment ago, or that limits of now no longer accept.
    pub fn read(&self) -> Result<Arc<Environment>, Problem> {
        let read = || {
            let bytes = std::fs::read(self.file.path()).map_err(|error| match error.kind() {
                io::ErrorKind::NotFound => not_offered(&self.id),
                _ => Problem::internal(error),
            })?;
            Environment::from_bytes(&bytes, &self.app.config.limits)
                .map(|file| file.environment)
                .map_err(|error| no_longer(&self.id, &error))
        };
        self.app.environments.get_or_read(&self.id, read)
    }
}

impl App {
    /// What is on record of an environment.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownEnvironment`] when there is none.
    pub async fn environment(&self, id: &str) -> Result<EnvironmentRecord, Problem> {
        let record = self.catalogue.environment(id).await?;
        record.ok_or_else(|| unknown_environment(id))
    }

    /// Whether an environment has this id.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn has_environment(&self, id: &str) -> Result<bool, Problem> {
        Ok(ids::is(PREFIX, id) && self.catalogue.environment(id).await?.is_some())
    }

    /// The environment that something is to be lit with; `None` for the built-in studio.
    ///
    /// # Errors
    ///
    /// [`Problem`] with the parameter `environment` when there is none of this id.
    pub async fn unread(&self, id: Option<&str>) -> Result<Option<Unread>, Problem> {
        let Some(id) = id else {
            return Ok(None);
        };
        let record = self.catalogue.environment(id).await?;
        let record = record.ok_or_else(|| not_offered(id))?;
        match self.blobs.local(record.file).await? {
            Some(file) => Ok(Some(Unread {
                app: self.clone(),
                id: record.id,
                file,
            })),
            None if self.catalogue.environment(id).await?.is_none() => Err(not_offered(id)),
            None => Err(Problem::internal(format!("the file of {id} is not there"))),
        }
    }
}

/// The problem of an id that no environment has, as a parameter.
#[must_use]
pub fn not_offered(id: &str) -> Problem {
    Problem::parameter("environment", there_is_none(id)).accepting(format!(
        "{STUDIO}, or the id of an answer to POST /v1/environments"
    ))
}

/// The problem of an environment that was accepted under other limits.
fn no_longer(id: &str, error: &EnvironmentError) -> Problem {
    let detail =
        format!("The environment {id:?} is not accepted by this service any more: {error}.");
    Problem::parameter("environment", detail).accepting(format!(
        "{STUDIO}, or an environment within the limits of this service"
    ))
}

/// The problem of an address that no environment has.
#[must_use]
pub fn unknown_environment(id: &str) -> Problem {
    Problem::new(Kind::UnknownEnvironment, there_is_none(id))
        .accepting("the id of an answer to POST /v1/environments")
}

fn there_is_none(id: &str) -> String {
    format!("There is no environment {id:?}.")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;
    use std::sync::atomic::{AtomicUsize, Ordering};

    fn sky() -> Environment {
        Environment::uniform([1.0; 3])
    }

    #[test]
    fn who_needs_one_at_a_time_shares_it_however_little_room_there_is() {
        let environments = Environments::new(0);
        let reads = AtomicUsize::new(0);
        let get = || {
            environments.get_or_read("e_1", || {
                reads.fetch_add(1, Ordering::SeqCst);
                std::thread::sleep(std::time::Duration::from_millis(50));
                Ok::<_, Infallible>(sky())
            })
        };
        let used = std::thread::scope(|scope| {
            let all: Vec<_> = (0..4).map(|_| scope.spawn(get)).collect();
            let all = all.into_iter().map(|one| one.join().expect("reads"));
            all.collect::<Vec<_>>()
        });
        assert_eq!((used.len(), reads.load(Ordering::SeqCst)), (4, 1));
        drop(used);
        assert!(get().is_ok());
        assert_eq!(reads.load(Ordering::SeqCst), 2, "nobody kept it");
        assert!(lock(&environments.held).kept.is_empty());
    }

    #[test]
    fn the_last_used_are_kept_while_there_is_room() {
        let each = sky().bytes() as u64;
        let environments = Environments::new(2 * each);
        let is_kept = |id: &str| {
            let read = environments.get_or_read(id, || Err("read"));
            read.is_ok()
        };
        for id in ["e_1", "e_2", "e_1", "e_3"] {
            let read = environments.get_or_read(id, || Ok::<_, Infallible>(sky()));
            assert!(read.is_ok());
        }
        assert!(is_kept("e_1") && is_kept("e_3") && !is_kept("e_2"));
        environments.forget("e_1");
        assert!(!is_kept("e_1") && is_kept("e_3"));
    }
}
