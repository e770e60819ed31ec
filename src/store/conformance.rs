//! The contract, run on every backend: a new one passes these before it is offered.

use bytes::Bytes;
use futures::TryStreamExt;

use super::*;

/// What [`Blobs`] promises, on an empty store.
async fn blobs_conform(blobs: &dyn Blobs) {
    let silver = Bytes::from(vec![b's'; 3 << 20]);
    let hash = Hash::of(&silver);
    assert!(blobs.read(hash).await.expect("reads").is_none());
    assert!(blobs.stream(hash).await.expect("reads").is_none());
    assert!(blobs.local(hash).await.expect("reads").is_none());

    let mut writer = blobs.begin().await.expect("begins");
    for piece in silver.chunks(1000) {
        writer
            .append(silver.slice_ref(piece))
            .await
            .expect("appends");
        assert!(
            blobs.local(hash).await.expect("reads").is_none(),
            "a half-written blob is seen"
        );
    }
    let stored = writer.finish().await.expect("finishes");
    assert_eq!(
        stored,
        Stored {
            hash,
            length: 3 << 20
        }
    );
    assert_eq!(
        blobs.read(hash).await.expect("reads").expect("is there"),
        silver
    );
    assert_eq!(
        blobs.put(silver.clone()).await.expect("the same again"),
        stored
    );

    let streamed = blobs.stream(hash).await.expect("reads").expect("is there");
    assert_eq!(streamed.length, 3 << 20);
    let pieces: Vec<Bytes> = streamed.pieces.try_collect().await.expect("streams");
    assert!(pieces.len() > 1 && pieces.concat() == silver);
    let local = blobs.local(hash).await.expect("reads").expect("is there");
    assert_eq!(std::fs::read(local.path()).expect("is a file"), silver);

    let mut forgotten = blobs.begin().await.expect("begins");
    forgotten
        .append(Bytes::from_static(b"never finished"))
        .await
        .expect("appends");
    drop(forgotten);
    assert!(
        blobs
            .read(Hash::of(b"never finished"))
            .await
            .expect("reads")
            .is_none()
    );

    let nothing = blobs
        .put(Bytes::new())
        .await
        .expect("an empty blob is a blob");
    assert_eq!(
        blobs.read(nothing.hash).await.expect("reads"),
        Some(Bytes::new())
    );

    let mut all = blobs.all().await.expect("lists");
    all.sort();
    let mut want = vec![hash, nothing.hash];
    want.sort();
    assert_eq!(all, want);
    blobs.remove(hash).await.expect("removes");
    blobs
        .remove(hash)
        .await
        .expect("removing nothing is no error");
    assert!(blobs.read(hash).await.expect("reads").is_none());
    assert_eq!(blobs.put(silver).await.expect("and back").hash, hash);
}

fn paint(id: &str, name: &str, measurement: Option<Hash>) -> PaintRecord {
    PaintRecord {
        id: id.to_owned(),
        name: name.to_owned(),
        source: "package".to_owned(),
        measurement,
        paint: Hash::of(id.as_bytes()),
        content: Hash::of(b"content"),
        visibility: Visibility::Published,
    }
}

fn names(page: &PaintPage) -> Vec<&str> {
    page.paints
        .iter()
        .map(|paint| paint.name.as_str())
        .collect()
}

/// What [`Paints`] and [`Blends`] promise, on an empty catalogue.
#[allow(clippy::too_many_lines)] // one story, told in its order
async fn records_conform(catalogue: &dyn Catalogue) {
    let upload = Hash::of(b"upload");
    for (id, name) in [
        ("p_1", "Æther 50 % silver"),
        ("p_2", "blue"),
        ("p_3", "Silver_blue"),
    ] {
        assert!(
            catalogue
                .add_paint(&paint(id, name, Some(upload)))
                .await
                .expect("adds")
        );
    }
    assert!(
        !catalogue
            .add_paint(&paint("p_1", "another", None))
            .await
            .expect("adds nothing")
    );
    assert_eq!(
        catalogue
            .paint("p_1")
            .await
            .expect("reads")
            .expect("is there")
            .name,
        "Æther 50 % silver"
    );
    assert!(catalogue.paint("p_9").await.expect("reads").is_none());

    let all = catalogue
        .paints(None, Visibility::Published, None, 10)
        .await
        .expect("lists");
    assert_eq!(
        (names(&all), all.next),
        (vec!["Æther 50 % silver", "blue", "Silver_blue"], None)
    );
    for (q, found) in [
        ("SILVER", 2),
        ("æTHER", 1),
        ("%", 1),
        ("_", 1),
        ("'", 0),
        ("PACKAGE", 3),
        ("", 3),
    ] {
        assert_eq!(
            catalogue
                .paints(Some(q), Visibility::Published, None, 10)
                .await
                .expect("lists")
                .paints
                .len(),
            found,
            "{q}"
        );
    }
    let noted = async |q| {
        let noted = catalogue.noted(q, Visibility::Published, "kind").await;
        let noted = noted.expect("lists").into_iter();
        noted.map(|paint| paint.numbers).collect::<Vec<_>>()
    };
    assert_eq!(noted(None).await, [None, None, None]);
    let blob = Hash::of(b"p_2");
    for numbers in [[1.0, -2.0], [0.1, 1e-300]] {
        catalogue.note(blob, "kind", &numbers).await.expect("notes");
        catalogue.note(blob, "other", &[9.0]).await.expect("notes");
    }
    assert_eq!(noted(None).await, [None, Some(vec![0.1, 1e-300]), None]);
    assert_eq!(noted(Some("BLUE")).await.len(), 2);
    let nobody = catalogue.note(Hash::of(b"p_9"), "kind", &[1.0]).await;
    nobody.expect("notes nothing");

    let list = |visibility| catalogue.paints(None, visibility, None, 10);
    let hidden = catalogue.show_paint("p_2", Visibility::Private).await;
    assert!(hidden.expect("changes"));
    let private = list(Visibility::Private).await.expect("lists");
    let published = list(Visibility::Published).await.expect("lists");
    assert_eq!(
        (names(&private), names(&published).len()),
        (vec!["blue"], 2)
    );
    let shown = catalogue.show_paint("p_2", Visibility::Published).await;
    assert!(shown.expect("changes"));
    let nobody = catalogue.show_paint("p_9", Visibility::Private).await;
    assert!(!nobody.expect("changes nothing"));

    for (key, subject, tied) in [
        ("k", "p_1", "p_1"),
        ("k", "p_2", "p_1"),
        ("l", "p_2", "p_2"),
    ] {
        let told = catalogue.tie_key(key, subject, 2).await;
        assert_eq!(told.expect("ties"), tied);
    }
    for key in ["m", "n"] {
        catalogue.tie_key(key, "p_3", 2).await.expect("ties");
    }
    let again = catalogue.tie_key("k", "p_2", 2).await;
    assert_eq!(again.expect("ties"), "p_2", "the oldest key was forgotten");

    let first = catalogue
        .paints(None, Visibility::Published, None, 2)
        .await
        .expect("lists");
    let rest = catalogue
        .paints(None, Visibility::Published, first.next, 2)
        .await
        .expect("lists");
    assert_eq!(
        (names(&first).len(), names(&rest), rest.next),
        (2, vec!["Silver_blue"], None)
    );

    let blend = BlendRecord {
        id: "b_1".to_owned(),
        paints: vec!["p_2".to_owned(), "p_1".to_owned()],
        options: "{}".to_owned(),
        blend: Hash::of(b"p_2"),
    };
    assert!(catalogue.add_blend(&blend).await.expect("adds"));
    assert!(!catalogue.add_blend(&blend).await.expect("adds nothing"));
    assert_eq!(
        catalogue.blend("b_1").await.expect("reads"),
        Some(blend.clone())
    );
    assert!(catalogue.blend("b_2").await.expect("reads").is_none());

    let other = BlendRecord {
        id: "b_3".to_owned(),
        blend: Hash::of(b"only b_3"),
        ..blend
    };
    assert!(catalogue.add_blend(&other).await.expect("adds"));
    let file = other.blend;
    assert!(catalogue.names_blob(file).await.expect("asks"));
    let gone = catalogue.remove_blend("b_3").await.expect("removes");
    assert_eq!(gone, Some(other));
    let gone = catalogue
        .remove_blend("b_3")
        .await
        .expect("removes nothing");
    assert!(gone.is_none() && !catalogue.names_blob(file).await.expect("asks"));

    // A blob is named by paints, blends and the requests of unfinished jobs.
    let named = |blob: Hash| async move { catalogue.names_blob(blob).await.expect("asks") };
    let wants_it = new_job("j_wants", "p_4", &format!(r#"{{"upload":"{upload}"}}"#));
    catalogue.submit_job(&wants_it).await.expect("submits");
    for id in ["p_1", "p_2", "p_3"] {
        let gone = catalogue
            .remove_paint(id)
            .await
            .expect("removes")
            .expect("was there");
        assert_eq!(
            named(gone.paint).await,
            id == "p_2",
            "only a blend names that one"
        );
        assert!(named(upload).await);
        assert!(
            catalogue
                .remove_paint(id)
                .await
                .expect("removes nothing")
                .is_none()
        );
    }
    assert!(
        catalogue
            .end_job("j_wants", ended(JobState::Cancelled))
            .await
            .expect("ends")
    );
    assert!(!named(upload).await);
    assert!(
        catalogue
            .paints(None, Visibility::Published, None, 10)
            .await
            .expect("lists")
            .paints
            .is_empty()
    );
}

fn new_job(id: &str, subject: &str, request: &str) -> NewJob {
    NewJob {
        id: id.to_owned(),
        kind: JobKind::Ingest,
        subject: subject.to_owned(),
        request: request.to_owned(),
    }
}

/// An end of which nothing else is told.
fn ended(state: JobState) -> JobEnd<'static> {
    JobEnd {
        state,
        problem: None,
        stages: "[]",
    }
}

/// What [`Environments`] promises, on a catalogue without environments.
async fn environments_conform(catalogue: &dyn Catalogue) {
    let sky = EnvironmentRecord {
        id: "e_1".to_owned(),
        format: "hdr".to_owned(),
        width: 1024,
        height: 512,
        file: Hash::of(b"sky"),
        held: Some(r#"{"negative":3}"#.to_owned()),
    };
    let named = async |blob| catalogue.names_blob(blob).await.expect("asks");
    assert!(!named(sky.file).await);
    assert!(catalogue.add_environment(&sky).await.expect("adds"));
    let other = EnvironmentRecord {
        format: "exr".to_owned(),
        width: 8,
        file: Hash::of(b"other"),
        held: None,
        ..sky.clone()
    };
    assert!(
        !catalogue
            .add_environment(&other)
            .await
            .expect("adds nothing")
    );
    assert!(named(sky.file).await && !named(other.file).await);
    let found = catalogue.environment("e_1").await.expect("reads");
    assert_eq!(found.as_ref(), Some(&sky), "the first stays as it was");
    assert!(catalogue.environment("e_2").await.expect("reads").is_none());

    let list = async |cursor, limit| {
        let page = catalogue.environments(cursor, limit).await.expect("lists");
        (page.environments, page.next)
    };
    let other = EnvironmentRecord {
        id: "e_0".to_owned(),
        ..other
    };
    assert!(catalogue.add_environment(&other).await.expect("adds"));
    let (first, next) = list(None, 1).await;
    assert_eq!(first, std::slice::from_ref(&sky));
    assert!(next.is_some());
    assert_eq!(list(next, 1).await, (vec![other.clone()], None));
    assert_eq!(list(None, 9).await, (vec![sky.clone(), other], None));

    let gone = catalogue.remove_environment("e_1").await.expect("removes");
    assert_eq!(gone, Some(sky.clone()));
    let gone = catalogue.remove_environment("e_1").await.expect("removes");
    assert_eq!(gone, None);
    assert!(!named(sky.file).await);
}

/// What [`JobBook`] promises, on a catalogue without unfinished jobs.
async fn jobs_conform(catalogue: &dyn Catalogue) {
    let first = catalogue
        .submit_job(&new_job("j_1", "p_1", "{}"))
        .await
        .expect("submits");
    assert!(first.new);
    let same = catalogue
        .submit_job(&new_job("j_2", "p_1", "{}"))
        .await
        .expect("submits");
    assert!(
        !same.new && same.job.id == "j_1",
        "one unfinished job a subject"
    );
    assert!(
        catalogue
            .submit_job(&new_job("j_3", "p_2", "{}"))
            .await
            .expect("submits")
            .new
    );
    assert!(catalogue.job("j_2").await.expect("reads").is_none());

    let state = |id: &'static str| async move {
        let job = catalogue.job(id).await.expect("reads").expect("is there");
        (job.state, job.attempts)
    };
    catalogue.begin_job("j_1").await.expect("begins");
    assert_eq!(state("j_1").await, (JobState::Running, 1));
    catalogue.return_job("j_1").await.expect("returns");
    assert_eq!(state("j_1").await, (JobState::Queued, 0));
    catalogue.begin_job("j_1").await.expect("begins");
    let unfinished = catalogue.unfinished_jobs().await.expect("lists");
    assert_eq!(
        unfinished
            .iter()
            .map(|job| job.id.as_str())
            .collect::<Vec<_>>(),
        ["j_1", "j_3"]
    );

    assert!(
        catalogue
            .end_job(
                "j_1",
                JobEnd {
                    problem: Some("{}"),
                    stages: "[1]",
                    ..ended(JobState::Failed)
                },
            )
            .await
            .expect("ends")
    );
    assert!(
        !catalogue
            .end_job("j_1", ended(JobState::Done))
            .await
            .expect("an end is an end")
    );
    catalogue.begin_job("j_1").await.expect("changes nothing");
    assert_eq!(state("j_1").await, (JobState::Failed, 1));
    let there = catalogue.job("j_1").await.expect("reads").expect("there");
    assert_eq!(
        (there.problem.as_deref(), there.stages.as_deref()),
        (Some("{}"), Some("[1]"))
    );
    assert!(
        catalogue
            .submit_job(&new_job("j_4", "p_1", "{}"))
            .await
            .expect("submits")
            .new,
        "a failed job may be redone"
    );
    catalogue.ping().await.expect("answers");
}

#[tokio::test]
async fn a_folder_keeps_blobs() {
    let root = tempfile::tempdir().expect("temporary folder");
    blobs_conform(&FolderBlobs::open(root.path()).expect("opens")).await;
}

#[tokio::test]
async fn a_folder_sweeps_what_a_crash_left() {
    let root = tempfile::tempdir().expect("temporary folder");
    let blobs = FolderBlobs::open(root.path()).expect("opens");
    let kept = blobs
        .put(Bytes::from_static(b"kept"))
        .await
        .expect("writes");
    let mut writer = blobs.begin().await.expect("begins");
    writer
        .append(Bytes::from(vec![0; 4 << 20]))
        .await
        .expect("appends");
    std::mem::forget(writer);
    let incoming = || {
        std::fs::read_dir(root.path().join("incoming"))
            .expect("a folder")
            .count()
    };
    assert_eq!(incoming(), 1);
    let again = FolderBlobs::open(root.path()).expect("opens");
    assert_eq!(incoming(), 0);
    assert_eq!(
        again.read(kept.hash).await.expect("reads"),
        Some(Bytes::from_static(b"kept"))
    );
}

#[tokio::test]
async fn sqlite_keeps_records_and_jobs() {
    let root = tempfile::tempdir().expect("temporary folder");
    let file = root.path().join("catalogue.sqlite");
    let catalogue = SqliteCatalogue::open(&file).await.expect("opens");
    records_conform(&catalogue).await;
    environments_conform(&catalogue).await;
    jobs_conform(&catalogue).await;
    catalogue.close().await;
    let again = SqliteCatalogue::open(&file).await.expect("opens again");
    assert_eq!(
        again.unfinished_jobs().await.expect("lists").len(),
        2,
        "jobs survive"
    );
    assert!(
        again.blend("b_1").await.expect("reads").is_some(),
        "records survive"
    );
}
