//! Lines are found under noise, play and dead bands; what is no line is refused by its reason.

use super::*;
use proptest::prelude::*;

fn point(counts: f64, quantity: f64, branch: Branch) -> Point {
    Point { count: PwmCount::saturating(counts), quantity, branch }
}

/// A steering as Annex A.2 describes it: play either side, and readings that are off by up to
/// `misread_deg`, the same each time this is called.
fn steering(play_deg: f64, misread_deg: f64) -> Vec<Point> {
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(state >> 8) / f64::from(1 << 23) - 1.0) * misread_deg
    };
    let ways = [(Branch::Up, play_deg), (Branch::Down, -play_deg)];
    let way = |(branch, play)| (0..13).map(move |i| (2881.0 + 138.0 * f64::from(i), branch, play));
    let angle = |counts: f64| -0.0205 * (counts - 3720.0);
    ways.into_iter()
        .flat_map(way)
        .map(|(counts, branch, play)| point(counts, angle(counts) + play + noise(), branch))
        .collect()
}

/// A piston with a dead band of 12 counts, 3 % slower upwards, and a bend.
fn piston() -> Vec<Point> {
    (-10..=10)
        .map(|i| {
            let offset = 40.0 * f64::from(i) + 5.0;
            let beyond = (offset.abs() - 12.0).max(0.0);
            let load = 1.0 - 0.03 * offset.signum();
            let mps = offset.signum() * load * 5.0e-5 * beyond * (1.0 - (beyond / 1000.0).powi(3) / 4.0);
            let branch = match mps {
                0.0 => Branch::Still,
                mps if mps > 0.0 => Branch::Up,
                _ => Branch::Down,
            };
            point(3760.0 + offset, mps, branch)
        })
        .collect()
}

#[test]
fn an_exact_line_comes_back_exactly() {
    let fit = fit(&steering(0.0, 0.0)).unwrap();
    assert!((fit.line.slope + 0.0205).abs() < 1e-12 && (fit.zero_count - 3720.0).abs() < 1e-8, "{fit:?}");
    assert!((fit.r - 1.0).abs() < 1e-12 && fit.slope_error < 1e-12 && fit.scatter < 1e-9, "{fit:?}");
    assert_eq!(fit.points, 26);
    fit.check().unwrap();
}

#[test]
fn play_widens_the_branches_but_moves_neither_the_line_nor_its_errors() {
    let (without, with) = (fit(&steering(0.0, 0.5)).unwrap(), fit(&steering(0.5, 0.5)).unwrap());
    assert!((without.line.slope - with.line.slope).abs() < 1e-12);
    assert!((without.zero_count - with.zero_count).abs() < 1e-6);
    assert!((without.slope_error - with.slope_error).abs() < 1e-12);
    let apart_deg = with.hysteresis().unwrap();
    assert!((apart_deg - 1.0).abs() < 0.2, "twice the play: {apart_deg}");
    assert!(with.r < without.r && with.r > 0.99, "{with:?}");
    assert!((with.line.slope + 0.0205).abs() < 3.0 * with.slope_error, "{with:?}");
    assert!((with.zero_count - 3720.0).abs() < 3.0 * with.zero_error, "{with:?}");
}

#[test]
fn a_balanced_sweep_gives_annex_as_single_line() {
    let points = steering(0.7, 1.0);
    let single = Regression::of(points.iter().map(coordinates)).unwrap().line();
    let fit = fit(&points).unwrap();
    assert!((fit.line.slope / single.slope - 1.0).abs() < 1e-12);
    assert!((fit.line.intercept / single.intercept - 1.0).abs() < 1e-12);
}

#[test]
fn a_steering_with_a_lot_of_play_is_refused_for_its_r() {
    fit(&steering(1.5, 0.5)).unwrap().check().unwrap();
    let refused = fit(&steering(3.0, 0.5)).unwrap().check().unwrap_err();
    assert!(matches!(refused, FitError::WeakCorrelation { r } if r > 0.9 && r < MIN_R), "{refused}");
    assert!(refused.to_string().starts_with("R = 0.96"), "{refused}");
}

#[test]
fn a_pistons_dead_band_load_and_bend_hardly_touch_its_line() {
    let points = piston();
    let single = Regression::of(points.iter().map(coordinates)).unwrap().line();
    let fit = fit(&points).unwrap();
    fit.check().unwrap();
    assert!((fit.line.slope / 5.0e-5 - 1.0).abs() < 0.015, "{fit:?}");
    assert!((fit.zero_count - 3760.0).abs() < 1.0, "{fit:?}");
    assert!((fit.dead_band().unwrap() - 24.0).abs() < 6.0, "{:?}", fit.dead_band());
    assert!(single.slope / 5.0e-5 < 0.96, "one line through everything is too flat: {single:?}");
    assert!((single.count(0.0) - 3760.0).abs() > 4.0, "and beside the middle: {}", single.count(0.0));
}

#[test]
fn what_is_no_line_is_refused_with_its_reason() {
    let up = |quantities: &[f64]| -> Vec<Point> {
        (0..).zip(quantities).map(|(i, q)| point(3000.0 + 100.0 * f64::from(i), *q, Branch::Up)).collect()
    };
    assert_eq!(fit(&[]), Err(FitError::TooFewPoints { got: 0 }));
    assert_eq!(fit(&up(&[1.0, 2.0, 3.0])), Err(FitError::TooFewPoints { got: 3 }));
    assert_eq!(fit(&up(&[1.0, f64::NAN, 3.0, 4.0, 5.0])), Err(FitError::NotFinite));
    assert_eq!(fit(&up(&[1e308, -1e308, 1e308, -1e308, 1e308])), Err(FitError::NotFinite));
    let same = vec![point(3000.0, 1.0, Branch::Up); 9];
    assert_eq!(fit(&same), Err(FitError::NoSpread));
    assert!(matches!(fit(&up(&[7.0; 6])), Err(FitError::SlopeZero { .. })));
    let dead: Vec<_> = (0..9).map(|i| point(3400.0 + 80.0 * f64::from(i), 0.0, Branch::Still)).collect();
    assert_eq!(fit(&dead), Err(FitError::SlopeZero { slope: 0.0 }));
    let mounted_wrong = fit(&up(&[100.0, 101.0, 102.0, 103.0, 104.0])).unwrap();
    let refused = mounted_wrong.check().unwrap_err();
    assert!(matches!(refused, FitError::CentreOutOfLimits { count, .. } if count < 0.0), "{refused}");
}

#[test]
fn one_way_alone_is_fitted_as_a_single_line() {
    let points: Vec<_> = steering(0.5, 0.3).into_iter().filter(|p| p.branch == Branch::Up).collect();
    let fit = fit(&points).unwrap();
    assert_eq!((fit.branches, fit.hysteresis(), fit.dead_band()), (None, None, None));
    assert!((fit.line.slope + 0.0205).abs() < 3.0 * fit.slope_error);
    let off: f64 = points.iter().map(|point| fit.residual(point)).sum();
    assert!(off.abs() < 1e-9, "residuals of a least-squares line add up to nothing: {off}");
}

#[test]
fn a_pistons_speed_is_the_slope_of_its_height() {
    let heights: Vec<_> =
        (0..8_u64).map(|i| (Stamp::from_ms(100 + 38 * i), 0.02 + 0.010 * 0.038 * i as f64)).collect();
    assert!((speed_mps(&heights).unwrap() - 0.010).abs() < 1e-12);
    assert_eq!(speed_mps(&heights[..1]), None);
    assert_eq!(speed_mps(&[(Stamp::ZERO, 0.0), (Stamp::from_ms(38), f64::INFINITY)]), None);
}

fn branch() -> impl Strategy<Value = Branch> {
    prop_oneof![Just(Branch::Up), Just(Branch::Down), Just(Branch::Still)]
}

proptest! {
    #[test]
    fn a_line_is_recovered_as_well_as_its_noise_allows(
        slope in prop_oneof![-0.1..-0.001, 0.001..0.1_f64],
        zero in 3000.0..4500.0_f64,
        noise in prop::collection::vec(-1.0..1.0_f64, 26),
    ) {
        let points: Vec<_> = noise.iter().enumerate().map(|(i, noise)| {
            let (counts, branch) = if i < 13 { (i, Branch::Up) } else { (25 - i, Branch::Down) };
            let counts = 2881.0 + 138.0 * counts as f64;
            point(counts, slope * (counts - zero) + 0.3 * noise, branch)
        }).collect();
        let fit: Fit = fit(&points).unwrap();
        // Cauchy and Schwarz: readings off by at most 0.3 turn a line by at most 0.3 √(n / Sxx).
        let sxx = 26.0 * 138.0 * 138.0 * (13.0 * 13.0 - 1.0) / 12.0;
        prop_assert!(f64::abs(fit.line.slope - slope) <= 0.3 * (26.0_f64 / sxx).sqrt() + 1e-12);
        prop_assert!(f64::abs(fit.line.at(zero)) <= 0.3 * 2.5);
    }

    #[test]
    fn whatever_was_measured_r_is_within_0_and_1_and_everything_is_a_number(
        measured in prop::collection::vec((2331.0..5272.0_f64, any::<f64>(), branch()), 0..40),
        tame in any::<bool>(),
    ) {
        let points: Vec<_> = measured.into_iter().map(|(counts, quantity, branch)| {
            point(counts, if tame { quantity % 100.0 } else { quantity }, branch)
        }).collect();
        if let Ok(fit) = fit(&points) {
            prop_assert!((0.0..=1.0).contains(&fit.r), "{}", fit.r);
            for value in [fit.line.slope, fit.line.intercept, fit.slope_error, fit.intercept_error,
                          fit.zero_count, fit.zero_error, fit.scatter] {
                prop_assert!(value.is_finite(), "{fit:?}");
            }
            for value in [fit.hysteresis(), fit.dead_band()].into_iter().flatten() {
                prop_assert!(value.is_finite(), "{fit:?}");
            }
        }
    }
}
