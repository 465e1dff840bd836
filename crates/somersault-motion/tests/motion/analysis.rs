//! Principal components, common bases and groups.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use somersault_core::argument::ArgumentError;
use somersault_motion::analysis::{AnalysisError, Band, Pca, eigenpostures, normalize_frames};

fn samples() -> DMatrix<f64> {
    let entry = |i: usize, j: usize| {
        let (i, j) = (i as f64, j as f64);
        (1.3 * i + 0.7 * j * j + 0.4 * i * j).sin() * (j + 1.0)
    };
    DMatrix::from_fn(6, 4, entry)
}

#[test]
fn components_are_those_of_scikit_learn() {
    // sklearn.decomposition.PCA(3).fit(X), scikit-learn 1.9.1 with NumPy 2.4.6
    let variance = [8.387764690503381, 6.047429760909461, 0.8267413448938321];
    let ratio = [0.5325375389513859, 0.383950132208921, 0.05248964621737594];
    let components = [
        [-0.016959021248407934, 0.2002701043706545, -0.42846609802266644, 0.8809205865110058],
        [0.016333331331254943, -0.39951125621033146, 0.7851061470109908, 0.47300350566821714],
        [-0.132231078506257, 0.885358116954206, 0.4455224946266528, 0.012870641088090773],
    ];
    let scores = [
        [
            -0.17934211018949073,
            3.512083613682793,
            -4.608676370149065,
            2.6746564221661604,
            -0.38310716575941833,
            -1.0156143897509786,
        ],
        [
            0.4628726507801295,
            -1.5744882146730392,
            0.5614377233066499,
            3.05385896788435,
            -3.969229758178331,
            1.465548630880241,
        ],
        [
            1.2344780614045736,
            -0.5692084455699751,
            -1.0429588462542063,
            -0.6115027393567929,
            0.08543632527110429,
            0.903755644505296,
        ],
    ];
    let pca = Pca::fit(&samples(), 3).unwrap();
    let found = pca.scores(&samples()).unwrap();
    for k in 0..3 {
        assert!((pca.explained_variance()[k] - variance[k]).abs() < 1e-10);
        assert!((pca.explained_variance_ratio()[k] - ratio[k]).abs() < 1e-10);
        let component = pca.components().column(k).into_owned();
        let expected = DVector::from_row_slice(&components[k]);
        let sign = component.dot(&expected).signum();
        assert!((component - expected * sign).amax() < 1e-10, "component {k}");
        assert!((found.column(k) - DVector::from_row_slice(&scores[k]) * sign).amax() < 1e-10);
    }
}

#[test]
fn two_orthogonal_directions_are_found_in_closed_form() {
    // ±3 along (1, 1)/√2 and ±1 along (1, −1)/√2, about (5, 7)
    let (a, b) = (3.0 / 2.0_f64.sqrt(), 1.0 / 2.0_f64.sqrt());
    let rows = [5.0 + a, 7.0 + a, 5.0 - a, 7.0 - a, 5.0 + b, 7.0 - b, 5.0 - b, 7.0 + b];
    let pca = Pca::fit(&DMatrix::from_row_slice(4, 2, &rows), 2).unwrap();
    assert!((pca.mean() - DVector::from_row_slice(&[5.0, 7.0])).amax() < 1e-14);
    assert!((pca.explained_variance()[0] - 6.0).abs() < 1e-13);
    assert!((pca.explained_variance()[1] - 2.0 / 3.0).abs() < 1e-13);
    assert!((pca.total_variance() - 20.0 / 3.0).abs() < 1e-13);
    let h = 0.5_f64.sqrt();
    assert!((pca.components().column(0) - DVector::from_row_slice(&[h, h])).amax() < 1e-14);
}

#[test]
fn all_components_give_the_samples_back_on_either_shape() {
    for (n, p) in [(40, 7), (7, 300)] {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let samples = DMatrix::from_fn(n, p, |_, _| rng.random_range(-1.0..1.0));
        let k = (n - 1).min(p);
        let pca = Pca::fit(&samples, k).unwrap();
        let scores = pca.scores(&samples).unwrap();
        assert!((pca.reconstruct(&scores).unwrap() - &samples).amax() < 1e-12);
        let nan = DMatrix::from_element(1, scores.ncols(), f64::NAN);
        assert_eq!(pca.reconstruct(&nan), Err(AnalysisError::NonFinite { argument: "scores", row: 0 }));
        let gram = pca.components().tr_mul(pca.components());
        assert!((gram - DMatrix::identity(k, k)).amax() < 1e-13);
        let covariance = scores.tr_mul(&scores) / (n - 1) as f64;
        let expected = DMatrix::from_diagonal(&DVector::from_row_slice(pca.explained_variance()));
        assert!((covariance - expected).amax() < 1e-12);
        assert!((pca.explained_variance_ratio().iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn a_common_basis_has_one_sign_where_single_ones_need_not() {
    let motion = |sign: f64, bent: f64| {
        DMatrix::from_fn(30, 3, |i, j| {
            let t = i as f64 / 29.0;
            [sign * t, 0.8 * sign * t + 0.01 * (9.0 * t).sin(), 1.5 * bent * (t * 3.0).cos()][j]
        })
    };
    let motions = [motion(1.0, 0.0), motion(0.9, 0.0), motion(-1.0, 1.0)];
    let common = eigenpostures::common(&motions, 2).unwrap();
    assert_eq!(common.n_samples(), 90);
    let single = eigenpostures::per_motion(&motions, 2).unwrap();
    assert_eq!(single.len(), 3);
    let stacked = DMatrix::from_fn(90, 3, |i, j| motions[i / 30][(i % 30, j)]);
    assert_eq!(common, Pca::fit(&stacked, 2).unwrap());
    // the first single basis is along the line of the first motion, the third is not
    let along = |k: usize| single[k].components().column(0).dot(&single[0].components().column(0)).abs();
    assert!(along(1) > 0.999 && along(2) < 0.9);
    let wrong = eigenpostures::common(&[motion(1.0, 0.0), DMatrix::zeros(3, 2)], 2);
    assert_eq!(
        wrong,
        Err(AnalysisError::Argument(ArgumentError::Length {
            argument: "columns of motions",
            expected: 3,
            found: 2
        }))
    );
}

#[test]
fn bands_are_mean_and_deviation() {
    let band = Band::of(&DMatrix::from_row_slice(3, 2, &[1.0, 5.0, 2.0, 5.0, 6.0, 5.0])).unwrap();
    assert_eq!(band.mean, [3.0, 5.0]);
    assert!((band.deviation[0] - 7.0_f64.sqrt()).abs() < 1e-15 && band.deviation[1] == 0.0);
    let times: Vec<f64> = (0..13).map(|i| 0.1 * f64::from(i)).collect();
    let values: Vec<f64> = times.iter().map(|t| t * t * t).collect();
    let found = normalize_frames(&times, &values, 60).unwrap();
    for (k, x) in found.iter().enumerate() {
        assert!((x - (1.2 * k as f64 / 59.0).powi(3)).abs() < 1e-13);
    }
}

#[test]
fn what_cannot_be_analysed_is_refused() {
    let found = Pca::fit(&samples(), 5);
    let expected =
        AnalysisError::Components { argument: "n_components", found: 5, most: 4, samples: 6, features: 4 };
    assert_eq!(found, Err(expected));
    assert!(matches!(Pca::fit(&samples(), 0), Err(AnalysisError::Components { .. })));
    let one = Pca::fit(&DMatrix::zeros(1, 4), 1);
    assert_eq!(
        one,
        Err(AnalysisError::Argument(ArgumentError::TooFew { argument: "samples", least: 2, found: 1 }))
    );
    assert_eq!(Pca::fit(&DMatrix::from_element(5, 3, 0.1), 1), Err(AnalysisError::NoVariance));
    let mut bad = samples();
    bad[(3, 1)] = f64::NAN;
    assert_eq!(Pca::fit(&bad, 2), Err(AnalysisError::NonFinite { argument: "samples", row: 3 }));
    let pca = Pca::fit(&samples(), 2).unwrap();
    let found = pca.scores(&DMatrix::zeros(2, 5));
    assert_eq!(
        found,
        Err(AnalysisError::Argument(ArgumentError::Length {
            argument: "columns of samples",
            expected: 4,
            found: 5
        }))
    );
}
