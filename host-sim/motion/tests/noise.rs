//! White noise of a torque through the joint's limiter: never made larger, and made less by the path of the torque
//! before.

use flexspline::{
    Adjustment, Drive, FixedMember, GeneratorAngle, Images, Input, Joint, JointState, Limits, Mode, OutputAngle,
    Overrun, Store, TorquePath, TorqueReading, TorqueSettings,
};
use flexspline_motion::flight::ARCSEC_PER_RAD;
use flexspline_motion::gear::{Gear, SampledSpring, Spring};
use flexspline_motion::noise::NoiseSource;
use flexspline_motion::table::{Sampling, image};

/// Correction wanted by the noise and correction made, arcsec rms, of a joint at rest under a load.
fn through(acceleration_rad_s2: f32, bandwidth_hz: Option<f32>) -> [f64; 2] {
    let drive = Drive::new(188, 190, FixedMember::Flexspline).unwrap();
    // 55″ for each N·m, as a two-roller drive at light load.
    let law = |_: f64, flank: f64| (30.0 + 55.0 * flank) / ARCSEC_PER_RAD;
    let spring = Spring::Sampled(Box::new(SampledSpring::of_law(188.0, 20.0, law)));
    let gear = Gear { ratio: drive.exact_ratio(), lines: Vec::new(), spring };
    let sampling = Sampling { largest_n_m: 10.0, drag_n_m: 0.02, temperature_c: 20.0, noise_rad: 0.0 };
    let made = image(&gear, drive, &sampling, |_| [0; 8]).unwrap();
    let twin = made.clone();
    let images = Images::new(&made, &twin);
    let mut store = Store::new();
    store.activate(&images, &drive, 20.0).unwrap();
    let mut state = JointState::new();
    state.request(Mode::Tracking).unwrap();
    let limits = Limits {
        tick_s: 1e-3,
        rate_rad_s: 0.05,
        acceleration_rad_s2,
        generator_rate_rad_s: 600.0,
        debounce_ticks: 5,
        deadband_rad: 5e-6,
    };
    let joint = Joint::new(drive, limits, Overrun::SkipAndCount).unwrap();
    let mut path = bandwidth_hz.map(|bandwidth_hz| {
        let settings = TorqueSettings {
            tick_s: 1e-3,
            bandwidth_hz,
            drag_n_m: 0.0,
            table_drag_n_m: 0.0,
            hold_n_m: 0.0,
            settle_s: 0.0,
            largest_n_m: 1e6,
        };
        TorquePath::new(settings).unwrap()
    });
    let mut noise = NoiseSource::new(11);
    let mut generator = GeneratorAngle::ZERO;
    let (mut wanted, mut made) = ([0.0; 2], [0.0; 2]);
    let mut count = 0.0;
    for tick in 0..30_000 {
        let read = (4.0 + 0.3 * noise.normal()) as f32;
        let direction = flexspline::Direction::Forward;
        let torque_n_m = path.as_mut().map_or(read, |path| path.tick(TorqueReading::InMesh(read), direction));
        let input = Input {
            generator: Some(generator),
            target: OutputAngle::from_rad(0.01).unwrap(),
            torque_n_m,
            missed_ticks: 0,
            adjustment: Adjustment::default(),
        };
        let out = joint.tick(&images, &mut store, &mut state, &input);
        generator = out.command;
        if tick > 5_000 {
            for (sums, value) in
                [(&mut wanted, 55.0 * f64::from(read)), (&mut made, f64::from(out.correction_rad) * ARCSEC_PER_RAD)]
            {
                sums[0] += value;
                sums[1] += value * value;
            }
            count += 1.0;
        }
    }
    [wanted, made].map(|[sum, squares]: [f64; 2]| (squares / count - (sum / count).powi(2)).max(0.0).sqrt())
}

#[test]
fn noise_out_is_no_more_than_noise_in_and_less_with_the_path_of_the_torque() {
    for acceleration in [0.5, 5.0, 50.0, 1000.0] {
        let [wanted, bare] = through(acceleration, None);
        let [_, behind] = through(acceleration, Some(10.0));
        println!(
            "{acceleration} rad/s2: {wanted:.1} arcsec wanted by the noise, {bare:.1} made as it is, {behind:.1} \
             behind 10 Hz"
        );
        assert!(bare <= wanted, "{acceleration}: {bare} {wanted}");
        assert!(behind < 0.25 * wanted, "{acceleration}: {behind} {wanted}");
    }
}
