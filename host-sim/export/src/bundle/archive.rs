//! A folder as one `.tar.gz`: POSIX ustar, the same bytes for the same files.

use std::io::{self, Write};

use flate2::Compression;
use flate2::write::GzEncoder;

const BLOCK: usize = 512;

/// Writes files below the folder `top` of an archive.
///
/// # Errors
/// A path longer than 100 letters; what `out` says.
pub fn tar_gz(out: &mut dyn Write, top: &str, files: &[(String, Vec<u8>)]) -> io::Result<()> {
    let mut out = GzEncoder::new(out, Compression::best());
    for (path, contents) in files {
        out.write_all(&header(&format!("{top}/{path}"), contents.len())?)?;
        out.write_all(contents)?;
        out.write_all(&[0; BLOCK][..contents.len().next_multiple_of(BLOCK) - contents.len()])?;
    }
    out.write_all(&[0; 2 * BLOCK])?;
    out.finish()?;
    Ok(())
}

fn header(path: &str, bytes: usize) -> io::Result<[u8; BLOCK]> {
    let mut header = [0u8; BLOCK];
    let mut put = |at: usize, text: &str| header[at..at + text.len()].copy_from_slice(text.as_bytes());
    if path.len() > 100 {
        return Err(io::Error::other(format!("{path}: longer than 100 letters")));
    }
    put(0, path);
    put(100, "0000644\0");
    put(108, "0000000\0");
    put(116, "0000000\0");
    put(124, &format!("{bytes:011o}\0"));
    put(136, "00000000000\0");
    put(148, "        ");
    put(156, "0");
    put(257, "ustar\x0000");
    let sum: u32 = header.iter().map(|byte| u32::from(*byte)).sum();
    header[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    Ok(header)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tar_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        let files = [("a.txt".to_owned(), b"one".to_vec()), ("b/c.bin".to_owned(), vec![7; 1024])];
        let mut archive = Vec::new();
        tar_gz(&mut archive, "top", &files).unwrap();
        std::fs::write(folder.path().join("x.tar.gz"), archive).unwrap();
        let run =
            std::process::Command::new("tar").args(["xzf", "x.tar.gz"]).current_dir(folder.path()).status().unwrap();
        assert!(run.success());
        for (path, contents) in &files {
            assert_eq!(&std::fs::read(folder.path().join("top").join(path)).unwrap(), contents);
        }
        assert!(tar_gz(&mut Vec::new(), "top", &[("x".repeat(100), Vec::new())]).is_err());
    }
}
