//! Uploads: chunks in any order, of any length, with any announcement.

use crate::Choices;
use crate::tables::BASES;
use flexspline::{Upload, UploadError};

/// One upload beside a model of it.
pub fn run(data: &[u8]) {
    let mut choices = Choices::new(data);
    let image = &BASES[choices.below(BASES.len())];
    let announced = if choices.below(4) == 0 { usize::from(choices.any::<u16>()) } else { image.len() };
    let mut buffer = vec![0xa5; if choices.below(4) == 0 { usize::from(choices.any::<u16>()) } else { image.len() }];
    let room = buffer.len();
    let Ok(mut upload) = Upload::begin(&mut buffer, announced) else {
        assert!(announced > room);
        return;
    };
    assert!(announced <= room);
    let mut expected: Vec<u8> = Vec::new();
    while !choices.is_empty() {
        let next = upload.received();
        assert_eq!(next, expected.len());
        let offset = match choices.below(8) {
            0 => usize::from(choices.any::<u16>()),
            1 => usize::MAX - choices.below(300),
            _ => next,
        };
        let length = [1, 7, 64, 256, 4096, 65_535][choices.below(6)].min(1 + choices.below(65_536));
        let mut chunk: Vec<u8> = image.iter().skip(offset).take(length).copied().collect();
        match choices.below(16) {
            0 => chunk.push(choices.any()),
            1 => chunk.iter_mut().take(1).for_each(|byte| *byte ^= 1 << choices.below(8)),
            2 => chunk.clear(),
            _ => {}
        }
        match upload.chunk(offset, &chunk) {
            Ok(()) => {
                assert_eq!(offset, next);
                expected.extend_from_slice(&chunk);
                assert!(expected.len() <= announced);
            }
            Err(UploadError::Order { expected, found }) => {
                assert!((expected, found) == (next, offset) && offset != next)
            }
            Err(UploadError::TooLong { found, .. }) => assert!(found > announced),
            Err(error) => panic!("{error}"),
        }
    }
    match upload.finish() {
        Ok(table) => assert!(table.image() == &image[..] && expected == *image),
        Err(UploadError::Incomplete { found, .. }) => assert!(found == expected.len() && found < announced),
        Err(UploadError::Image(_)) => assert!(expected.len() == announced && expected != *image),
        Err(error) => panic!("{error}"),
    }
}
