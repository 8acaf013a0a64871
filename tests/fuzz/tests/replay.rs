//! Findings of libFuzzer, and the seeds it starts from, played again.

use std::fs;
use std::path::Path;

fn replay(target: &str, run: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(target);
    let mut files: Vec<_> = fs::read_dir(&folder).expect("a corpus").map(|file| file.expect("a file").path()).collect();
    files.sort();
    assert!(files.len() > 2, "no corpus in {}", folder.display());
    // In an interpreter a few have to do.
    let most = if cfg!(miri) { 3 } else { usize::MAX };
    for file in files.into_iter().take(most) {
        println!("{}", file.display());
        let bytes = fs::read(&file).expect("readable");
        run(if cfg!(miri) { bytes.get(..300).unwrap_or(&bytes) } else { &bytes });
    }
    if cfg!(miri) {
        return;
    }
    // Numbers that look random, the same in every run.
    let mut seed = 0x9e37_79b9_7f4a_7c15u64;
    for _ in 0..200 {
        let bytes: Vec<u8> = std::iter::repeat_with(|| {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 56) as u8
        })
        .take(400)
        .collect();
        run(&bytes);
    }
}

macro_rules! replays {
    ($($target:ident)*) => {
        $(#[test]
        fn $target() {
            replay(stringify!($target), flexspline_fuzz::$target::run);
        })*
    };
}

replays! { image upload store c_interface saved runtime }
