//! ros2_control: the parameters of `transmission_interface/SimpleTransmission`: joint = actuator/reduction + offset. It
//! holds no curve, so it leaves all that changes.

use flexspline::Direction;

use super::{BOTH, FIT_POINTS, Origin, Player, Section, Written, mean};

/// Parameters of a simple transmission.
#[derive(Debug, Clone, Copy)]
pub struct Ros2 {
    reduction: f64,
    offset_rad: f64,
}

impl Ros2 {
    /// The drive's ratio, and the mean error at this load.
    pub fn fit(section: &Section<'_>) -> Ros2 {
        let samples = section.samples(None, FIT_POINTS, &BOTH);
        let offset_rad = mean(samples.iter().map(|sample| sample.error_rad));
        Ros2 { reduction: section.ratio(), offset_rad }
    }
}

impl Player for Ros2 {
    fn correction_rad(&self, _: f64, _: Direction) -> f64 {
        -self.offset_rad
    }

    fn points(&self) -> String {
        "a simple transmission holds a reduction and an offset, no curve".to_owned()
    }

    fn files(&self, origin: &Origin) -> Vec<Written> {
        let lines = origin.lines("joint position = actuator position / reduction + offset; rad").join("\n  ");
        let text = format!(
            "<!--\n  {lines}\n-->\n<transmission name=\"flexspline\">\n  \
             <plugin>transmission_interface/SimpleTransmission</plugin>\n  <actuator name=\"generator\" \
             role=\"actuator1\"/>\n  <joint name=\"output\" role=\"joint1\">\n    \
             <mechanical_reduction>{}</mechanical_reduction>\n    <offset>{:.9}</offset>\n  \
             </joint>\n</transmission>\n",
            self.reduction, self.offset_rad
        );
        vec![Written::text("transmission.xml", text)]
    }
}
