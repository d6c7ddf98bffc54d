use super::*;

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn appears_only_when_committed() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    let mut file = AtomicFile::create(&target, false).unwrap();
    file.write_all(b"whole").unwrap();
    assert!(!target.exists());
    file.commit().unwrap();
    assert_eq!(fs::read(&target).unwrap(), b"whole");
    assert_eq!(names(folder.path()), ["out.wav"]);
}

#[test]
fn leaves_nothing_when_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = AtomicFile::create(&folder.path().join("out.wav"), false).unwrap();
    file.write_all(b"half").unwrap();
    drop(file);
    assert!(names(folder.path()).is_empty());
}

/// Not one that only its owner may read.
#[cfg(unix)]
#[test]
fn a_new_file_has_the_permissions_of_an_ordinary_one() {
    let folder = tempfile::tempdir().unwrap();
    let (target, ordinary) = (folder.path().join("out.wav"), folder.path().join("ordinary"));
    AtomicFile::create(&target, false).unwrap().commit().unwrap();
    fs::write(&ordinary, "").unwrap();
    let permissions = |path: &Path| path.metadata().unwrap().permissions();
    assert_eq!(permissions(&target), permissions(&ordinary));
}

#[test]
fn replaces_only_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    fs::write(&target, "old").unwrap();
    let error = AtomicFile::create(&target, false).unwrap_err();
    assert!(matches!(error, FileError::Exists { .. }) && error.to_string().contains("another name"));
    assert_eq!(fs::read(&target).unwrap(), b"old");
    AtomicFile::create(&target, true).unwrap().commit().unwrap();
    assert_eq!(fs::read(&target).unwrap(), b"");
}

#[test]
fn what_came_in_between_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    // Two runs that began before either of them ended.
    let mut first = AtomicFile::create(&target, false).unwrap();
    let mut second = AtomicFile::create(&target, false).unwrap();
    first.write_all(b"first").unwrap();
    second.write_all(b"second").unwrap();
    first.commit().unwrap();
    assert!(matches!(second.commit().unwrap_err(), FileError::Exists { .. }));
    assert_eq!(fs::read(&target).unwrap(), b"first");
    assert_eq!(names(folder.path()), ["out.wav"]);
}

#[test]
fn a_name_as_long_as_the_system_allows_is_no_fault() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("x".repeat(250));
    AtomicFile::create(&target, false).unwrap().commit().unwrap();
    assert!(target.exists());
}

#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_permissions_and_is_never_more_open() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("out.wav");
    for mode in [0o600, 0o640, 0o444] {
        let _ = fs::remove_file(&target);
        fs::write(&target, "old").unwrap();
        fs::set_permissions(&target, fs::Permissions::from_mode(mode)).unwrap();
        let file = AtomicFile::create(&target, true).unwrap();
        assert_eq!(file.hidden_name().metadata().unwrap().permissions().mode() & 0o777, mode);
        file.commit().unwrap();
        assert_eq!(target.metadata().unwrap().permissions().mode() & 0o777, mode);
    }
}

#[cfg(unix)]
#[test]
fn links_are_followed_or_refused_but_never_replaced() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("sub")).unwrap();
    fs::write(path("sub/real"), "old").unwrap();
    symlink("sub/real", path("link")).unwrap();
    symlink("link", path("second")).unwrap();
    symlink("none", path("dangling")).unwrap();
    symlink("circle", path("circle")).unwrap();
    assert!(matches!(AtomicFile::create(&path("second"), false), Err(FileError::Exists { .. })));
    let mut file = AtomicFile::create(&path("second"), true).unwrap();
    file.write_all(b"new").unwrap();
    file.commit().unwrap();
    assert_eq!(fs::read(path("sub/real")).unwrap(), b"new");
    let error = AtomicFile::create(&path("dangling"), true).unwrap_err().to_string();
    assert!(error.contains("link to nothing"), "{error}");
    assert!(AtomicFile::create(&path("circle"), true).is_err());
    for name in ["link", "second", "dangling", "circle"] {
        assert!(path(name).symlink_metadata().unwrap().is_symlink(), "{name}");
    }
    assert_eq!(names(&path("sub")), ["real"]);
}

#[cfg(unix)]
#[test]
fn devices_pipes_and_sockets_are_never_replaced() {
    use std::os::unix::fs::FileTypeExt;
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("socket");
    let _listener = std::os::unix::net::UnixListener::bind(&target).unwrap();
    let error = AtomicFile::create(&target, true).unwrap_err().to_string();
    assert!(error.contains("socket") && error.contains("the name of a file"), "{error}");
    assert!(target.symlink_metadata().unwrap().file_type().is_socket());
    assert_eq!(names(folder.path()), ["socket"]);
}

#[test]
fn refuses_folders_and_missing_folders() {
    let folder = tempfile::tempdir().unwrap();
    assert!(AtomicFile::create(folder.path(), true).is_err());
    let error = AtomicFile::create(&folder.path().join("no/such/out.wav"), false).unwrap_err();
    assert!(error.to_string().contains("no/such/out.wav"));
}

#[test]
fn unfinished_files_can_be_removed_from_elsewhere() {
    // Not remove_unfinished itself: other tests of this process are writing.
    let folder = tempfile::tempdir().unwrap();
    let file = AtomicFile::create(&folder.path().join("out.wav"), false).unwrap();
    let hidden = file.hidden_name().to_owned();
    assert!(unfinished().contains(&hidden));
    file.commit().unwrap();
    assert!(!unfinished().contains(&hidden));
}

fn file(folder: &Path, name: &str, replace: bool) -> AtomicFile {
    let mut file = AtomicFile::create(&folder.join(name), replace).unwrap();
    file.write_all(b"new").unwrap();
    file
}

fn content(folder: &Path) -> Vec<(String, String)> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap());
    let pair = |entry: fs::DirEntry| {
        let text = fs::read_to_string(entry.path()).unwrap_or_else(|_| "folder".into());
        (entry.file_name().to_string_lossy().into_owned(), text)
    };
    let mut content: Vec<_> = entries.map(pair).collect();
    content.sort();
    content
}

fn pairs(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    pairs.iter().map(|&(name, text)| (name.to_owned(), text.to_owned())).collect()
}

#[test]
fn all_appear() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("b"), "old").unwrap();
    commit_all(vec![file(folder.path(), "a", true), file(folder.path(), "b", true)]).unwrap();
    assert_eq!(content(folder.path()), pairs(&[("a", "new"), ("b", "new")]));
}

#[test]
fn none_appears_if_one_is_taken_meanwhile() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["a", "b", "c"].map(|name| file(folder.path(), name, false));
    fs::write(folder.path().join("c"), "another's").unwrap();
    assert!(matches!(commit_all(files.into()), Err(FileError::Exists { .. })));
    assert_eq!(content(folder.path()), pairs(&[("c", "another's")]));
}

/// A folder is not replaced by a file.
#[test]
fn what_has_its_name_already_is_named_if_another_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let files = ["a", "b"].map(|name| file(folder.path(), name, true));
    fs::create_dir(folder.path().join("b")).unwrap();
    fs::write(folder.path().join("b/inside"), "").unwrap();
    let error = commit_all(files.into()).unwrap_err().to_string();
    assert!(error.contains("/b: cannot give the finished file its name"), "{error}");
    assert!(error.contains("already in place: ") && error.ends_with("/a"), "{error}");
    assert_eq!(content(folder.path()), pairs(&[("a", "new"), ("b", "folder")]));
}

/// Unless it holds nothing.
#[test]
fn what_cannot_be_made_again_is_kept() {
    let folder = tempfile::tempdir().unwrap();
    let mut kept = file(folder.path(), "a", false);
    kept.keep();
    let hidden = kept.hidden_name().to_owned();
    drop(kept);
    assert_eq!(fs::read(&hidden).unwrap(), b"new");
    let mut empty = AtomicFile::create(&folder.path().join("b"), false).unwrap();
    empty.keep();
    drop(empty);
    assert_eq!(content(folder.path()).len(), 1);
}
