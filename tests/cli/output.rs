//! Where answers go: files that appear whole, pipes, readers who leave.

use std::fs;
use std::process::Command;

use crate::desk::Desk;

#[cfg(unix)]
#[test]
fn out_replaces_files_and_writes_through_everything_else() {
    use std::io::Read as _;
    use std::os::unix::fs::{FileTypeExt as _, PermissionsExt as _, symlink};
    let desk = Desk::new();
    let export = |out: &str| desk.ok(&["samples", "export", "white", "--out", out]);
    export("new.paint");
    let white = desk.read("new.paint");

    let mode = |name: &str| {
        let about = fs::metadata(desk.path(name)).expect("is there");
        about.permissions().mode() & 0o777
    };
    fs::write(desk.path("plain"), b"").expect("written");
    assert_eq!(mode("new.paint"), mode("plain"), "the umask decides");
    fs::write(desk.path("old.paint"), b"old").expect("written");
    fs::set_permissions(desk.path("old.paint"), fs::Permissions::from_mode(0o640)).expect("is set");
    export("old.paint");
    assert_eq!(
        (mode("old.paint"), desk.read("old.paint")),
        (0o640, white.clone())
    );

    fs::create_dir(desk.path("there")).expect("made");
    symlink("there/real.paint", desk.path("link.paint")).expect("linked");
    for _ in 0..2 {
        export("link.paint");
        assert!(desk.path("link.paint").is_symlink());
        assert_eq!(desk.read("there/real.paint"), white);
    }

    let pipe = desk.path("pipe");
    assert!(
        Command::new("mkfifo")
            .arg(&pipe)
            .status()
            .expect("runs")
            .success()
    );
    let reader = std::thread::spawn({
        let pipe = pipe.clone();
        move || {
            let mut bytes = Vec::new();
            fs::File::open(pipe)
                .and_then(|mut file| file.read_to_end(&mut bytes))
                .map(|_| bytes)
        }
    });
    export("pipe");
    assert_eq!(reader.join().expect("reads").expect("reads"), white);
    let still = fs::symlink_metadata(&pipe).expect("is there");
    assert!(still.file_type().is_fifo(), "a pipe stays a pipe");
}

#[test]
fn a_reader_who_has_heard_enough_is_no_error() {
    use std::process::Stdio;
    let desk = Desk::with_blend();
    for words in [
        &["show", "b.blend"][..],
        &["samples", "list"],
        &["samples", "list", "--json"],
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_carpaint"))
            .current_dir(desk.folder.path())
            .args(words)
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("starts");
        drop(child.stdout.take());
        let output = child.wait_with_output().expect("ends");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.success() && said.is_empty(),
            "{words:?}: {said}"
        );
    }
}
