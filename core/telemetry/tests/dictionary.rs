//! The dictionary of a record of telemetry, for the ground: an XTCE file, made here, and a record read by that file
//! alone.

use flexspline::{Flags, Health, Mode, Quality};
use flexspline_telemetry::{RECORD_BYTES, Record};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// How the bits of a parameter are meant.
enum Kind {
    Bytes,
    Unsigned,
    Signed,
    Float,
    Flag,
    /// Names of 0, 1, 2...
    Names(&'static [&'static str]),
}
use Kind::{Bytes, Flag, Float, Names, Signed, Unsigned};

/// Name, bits, kind, unit and meaning of every parameter, in the order of the bytes and in each from the highest bit
/// down.
const PARAMETERS: &[(&str, usize, Kind, &str, &str)] = &[
    ("mark", 16, Bytes, "", "FX"),
    ("version", 8, Unsigned, "", "version of the record: 2"),
    ("reserved_1", 1, Unsigned, "", "zero"),
    ("health", 3, Names(&["sound", "one image", "lost", "empty", "torn"]), "", "health of the table"),
    ("mode", 2, Names(&["off", "tracking", "hold", "safe"]), "", "what the joint does with its correction"),
    ("quality", 2, Names(&["in range", "uncertain", "extrapolated", "disabled"]), "", "how far to trust it"),
    ("number", 16, Unsigned, "", "number of the record; wraps"),
    ("lost", 16, Unsigned, "", "records lost since the start; wraps"),
    ("tick", 32, Unsigned, "", "number of the tick"),
    ("joint_torn", 1, Flag, "", "settings of the joint are not whole"),
    ("state_torn", 1, Flag, "", "the state was not whole"),
    ("table_doubt", 1, Flag, "", "what was read of the table was not whole"),
    ("not_corrected", 1, Flag, "", "no correction could be made"),
    ("held_back_flag", 1, Flag, "", "the limiter held the correction back"),
    ("overrun", 1, Flag, "", "the tick came late"),
    ("glitch", 1, Flag, "", "the sample was not believed"),
    ("sample_lost", 1, Flag, "", "there was no sample"),
    ("reserved_5", 5, Unsigned, "", "zero"),
    ("bounded", 1, Flag, "", "the adjustment was larger than any may be"),
    ("other_images", 1, Flag, "", "an image is not the one that was activated"),
    ("safe", 1, Flag, "", "the joint is in mode safe"),
    ("missed_ticks", 16, Unsigned, "", "ticks missed since the start; wraps"),
    ("output", 64, Signed, "2^-32 turn", "estimated output"),
    ("transmission_error", 32, Float, "rad", "actual less ideal output"),
    ("uncertainty", 32, Float, "rad", "the error lies within plus and minus this"),
    ("correction", 32, Float, "rad", "correction at the output"),
    ("held_back", 32, Float, "rad", "what the limiter held back of it"),
    ("doubtful_ticks", 16, Unsigned, "", "ticks that were done again; wraps"),
    ("words_mended", 16, Unsigned, "", "words of the copies made anew; wraps"),
    ("words_skipped", 16, Unsigned, "", "words that could not be made anew; wraps"),
    ("pages_damaged", 16, Unsigned, "", "pages of an image found damaged; wraps"),
    ("crc32", 32, Unsigned, "", "CRC-32/ISO-HDLC of all bytes before"),
];

fn encoding(bits: usize, kind: &Kind) -> String {
    let order = if bits > 8 { " byteOrder=\"leastSignificantByteFirst\"" } else { "" };
    match kind {
        Bytes => {
            format!("<BinaryDataEncoding><SizeInBits><FixedValue>{bits}</FixedValue></SizeInBits></BinaryDataEncoding>")
        }
        Float => format!("<FloatDataEncoding encoding=\"IEEE754_1985\" sizeInBits=\"{bits}\"{order}/>"),
        Signed => format!("<IntegerDataEncoding encoding=\"twosComplement\" sizeInBits=\"{bits}\"{order}/>"),
        _ => format!("<IntegerDataEncoding encoding=\"unsigned\" sizeInBits=\"{bits}\"{order}/>"),
    }
}

fn dictionary() -> String {
    let (mut types, mut parameters, mut entries) = (String::new(), String::new(), String::new());
    for (name, bits, kind, unit, meaning) in PARAMETERS {
        let (element, more) = match kind {
            Bytes => ("BinaryParameterType", String::new()),
            Unsigned => ("IntegerParameterType", format!(" signed=\"false\" sizeInBits=\"{bits}\"")),
            Signed => ("IntegerParameterType", format!(" signed=\"true\" sizeInBits=\"{bits}\"")),
            Float => ("FloatParameterType", format!(" sizeInBits=\"{bits}\"")),
            Flag => ("BooleanParameterType", String::new()),
            Names(_) => ("EnumeratedParameterType", String::new()),
        };
        let unit =
            if unit.is_empty() { "<UnitSet/>".to_owned() } else { format!("<UnitSet><Unit>{unit}</Unit></UnitSet>") };
        let _ = write!(types, "      <{element} name=\"{name}_t\"{more}>{unit}{}", encoding(*bits, kind));
        if let Names(names) = kind {
            let list = names
                .iter()
                .enumerate()
                .map(|(value, label)| format!("<Enumeration value=\"{value}\" label=\"{label}\"/>"));
            let _ = write!(types, "<EnumerationList>{}</EnumerationList>", list.collect::<String>());
        }
        let _ = writeln!(types, "</{element}>");
        let _ = writeln!(
            parameters,
            "      <Parameter name=\"{name}\" parameterTypeRef=\"{name}_t\" shortDescription=\"{meaning}\"/>"
        );
        let _ = writeln!(entries, "          <ParameterRefEntry parameterRef=\"{name}\"/>");
    }
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <!-- A record of telemetry of the core. Made and checked by core/telemetry/tests/dictionary.rs. -->\n\
         <SpaceSystem xmlns=\"http://www.omg.org/spec/XTCE/20180204\" name=\"flexspline\">\n  <TelemetryMetaData>\n\
         \x20   <ParameterTypeSet>\n{types}    </ParameterTypeSet>\n\
         \x20   <ParameterSet>\n{parameters}    </ParameterSet>\n\
         \x20   <ContainerSet>\n      <SequenceContainer name=\"record\">\n\
         \x20       <EntryList>\n{entries}        </EntryList>\n\
         \x20     </SequenceContainer>\n    </ContainerSet>\n  </TelemetryMetaData>\n</SpaceSystem>\n"
    )
}

fn page() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/telemetry.xtce.xml")
}

fn kept() -> String {
    fs::read_to_string(page()).expect("docs/telemetry.xtce.xml")
}

#[test]
fn the_dictionary_is_up_to_date() {
    if std::env::var_os("FLEXSPLINE_KEEP_DICTIONARY").is_some() {
        fs::write(page(), dictionary()).expect("docs can be written");
    }
    assert!(
        kept() == dictionary(),
        "docs/telemetry.xtce.xml is not what is made: run this test with FLEXSPLINE_KEEP_DICTIONARY=1"
    );
}

/// The value of an attribute of an element.
fn attribute<'t>(element: &'t str, name: &str) -> Option<&'t str> {
    element.split(&format!(" {name}=\"")).nth(1)?.split('"').next()
}

/// Values of the bytes by name, decoded with the file alone.
fn read(file: &str, bytes: &[u8]) -> BTreeMap<String, f64> {
    let line = |what: &str, name: &str, value: &str| {
        let found =
            file.lines().find(|line| line.contains(&format!("<{what}")) && attribute(line, name) == Some(value));
        found.unwrap_or_else(|| panic!("no {what} of {value}")).to_owned()
    };
    let mut values = BTreeMap::new();
    let mut at = 0;
    for entry in file.lines().filter(|line| line.contains("<ParameterRefEntry")) {
        let name = attribute(entry, "parameterRef").unwrap();
        let parameter = line("Parameter ", "name", name);
        let kind =
            file.lines().find(|line| attribute(line, "name") == attribute(&parameter, "parameterTypeRef")).unwrap();
        let encoding = kind.split("DataEncoding").nth(1).unwrap();
        let fixed = encoding.split("<FixedValue>").nth(1).and_then(|rest| rest.split('<').next());
        let bits: usize = attribute(encoding, "sizeInBits").or(fixed).unwrap().parse().unwrap();
        let mut number = 0u64;
        if bits >= 8 {
            assert_eq!(at % 8, 0, "{name}");
            let part = &bytes[at / 8..(at + bits) / 8];
            let little = attribute(encoding, "byteOrder") == Some("leastSignificantByteFirst");
            assert!(little || bits == 8 || kind.contains("<Binary"), "{name}");
            for (i, byte) in part.iter().enumerate() {
                number |= u64::from(*byte) << (8 * i);
            }
        } else {
            for bit in at..at + bits {
                number = number << 1 | u64::from(bytes[bit / 8] >> (7 - bit % 8) & 1);
            }
        }
        at += bits;
        let value = match attribute(encoding, "encoding") {
            Some("IEEE754_1985") => f64::from(f32::from_bits(number as u32)),
            Some("twosComplement") => (number as i64) as f64,
            _ => number as f64,
        };
        if kind.contains("<Enumerated") {
            assert!(kind.contains(&format!("value=\"{number}\"")), "{name} {number}");
        }
        values.insert(name.to_owned(), value);
    }
    assert_eq!(at, 8 * bytes.len());
    values
}

#[test]
fn a_record_is_read_by_the_dictionary_alone() {
    let file = kept();
    let flags = [
        ("sample_lost", Flags::SAMPLE_LOST),
        ("glitch", Flags::GLITCH),
        ("overrun", Flags::OVERRUN),
        ("held_back_flag", Flags::HELD_BACK),
        ("not_corrected", Flags::NOT_CORRECTED),
        ("table_doubt", Flags::TABLE_DOUBT),
        ("state_torn", Flags::STATE_TORN),
        ("joint_torn", Flags::JOINT_TORN),
        ("safe", Flags::SAFE),
        ("other_images", Flags::OTHER_IMAGES),
        ("bounded", Flags::BOUNDED),
    ];
    let healths = [Health::Sound, Health::OneImage, Health::Lost, Health::Empty, Health::Torn];
    let modes = [Mode::Off, Mode::Tracking, Mode::Hold, Mode::Safe];
    let qualities = [Quality::InRange, Quality::Uncertain, Quality::Extrapolated, Quality::Disabled];
    for i in 0..1u16 << flags.len() {
        let [health, mode, quality] = [i % 5, i / 5 % 4, i / 20 % 4].map(usize::from);
        let set = flags.iter().enumerate().filter(|(bit, _)| i >> bit & 1 == 1);
        let record = Record {
            number: i,
            lost: i.wrapping_mul(77),
            tick: u32::from(i) * 1_000_003,
            quality: qualities[quality],
            mode: modes[mode],
            health: healths[health],
            flags: set.fold(0, |bits, (_, (_, flag))| bits | flag.bits()),
            missed_ticks: !i,
            output_counts: -i64::from(i) * 12_345_678_901,
            transmission_error_rad: 1e-5 * f32::from(i) - 0.004,
            uncertainty_rad: 1e-7 * f32::from(i),
            correction_rad: -2e-5 * f32::from(i),
            held_back_rad: 3e-6,
            doubtful_ticks: i ^ 0x55,
            words_mended: i ^ 0x99,
            words_skipped: i ^ 0x33,
            pages_damaged: i ^ 0x77,
        };
        let bytes: [u8; RECORD_BYTES] = record.encode();
        let found = read(&file, &bytes);
        let expected: [(&str, f64); 19] = [
            ("mark", f64::from(u16::from_le_bytes(*b"FX"))),
            ("version", 2.0),
            ("health", health as f64),
            ("mode", mode as f64),
            ("quality", quality as f64),
            ("number", record.number.into()),
            ("lost", record.lost.into()),
            ("tick", record.tick.into()),
            ("missed_ticks", record.missed_ticks.into()),
            ("output", record.output_counts as f64),
            ("transmission_error", record.transmission_error_rad.into()),
            ("uncertainty", record.uncertainty_rad.into()),
            ("correction", record.correction_rad.into()),
            ("held_back", record.held_back_rad.into()),
            ("doubtful_ticks", record.doubtful_ticks.into()),
            ("words_mended", record.words_mended.into()),
            ("words_skipped", record.words_skipped.into()),
            ("pages_damaged", record.pages_damaged.into()),
            ("crc32", u32::from_le_bytes(bytes[48..].try_into().unwrap()).into()),
        ];
        let expected = expected.into_iter().chain(["reserved_1", "reserved_5"].map(|name| (name, 0.0)));
        let set = flags.iter().enumerate().map(|(bit, (name, _))| (*name, f64::from(i >> bit & 1)));
        let expected: BTreeMap<String, f64> =
            expected.chain(set).map(|(name, value)| (name.to_owned(), value)).collect();
        assert_eq!(found, expected, "{record:?}");
    }
}
