"""Principal components beside scikit-learn's, on the same matrices.

    pip install scikit-learn
    python tests/python/compare_pca_with_sklearn.py

scikit-learn is no extra of the package: the tests hold `somersault.motion.Pca` against the definition that
scikit-learn computes, by NumPy, and this script shows that both are one.
"""

import numpy as np
import sklearn
from sklearn.decomposition import PCA

from somersault import motion


def main() -> None:
    rng = np.random.default_rng(7)
    print(f"scikit-learn {sklearn.__version__}, largest differences:")
    for shape in ((16, 500), (60, 7), (200, 60), (9, 9), (30, 3000)):
        samples = rng.normal(size=shape) * np.geomspace(3.0, 0.05, shape[1]) + rng.normal(size=shape[1])
        n = min(5, shape[0] - 1)
        own, other = motion.Pca(samples, n), PCA(n, svd_solver="full").fit(samples)
        signs = np.sign(np.sum(own.components * other.components_, axis=1))
        apart = np.abs(own.components - signs[:, None] * other.components_).max()
        scores = np.abs(own.scores(samples) - signs * other.transform(samples)).max()
        variance = np.abs(own.explained_variance / other.explained_variance_ - 1).max()
        ratio = np.abs(own.explained_variance_ratio - other.explained_variance_ratio_).max()
        print(
            f"{shape[0]:4} x {shape[1]:4}: components {apart:.1e}, scores {scores:.1e}, variances"
            f" {variance:.1e}"
            f" relative, shares {ratio:.1e}, {int((signs < 0).sum())} signs differ"
        )
        assert max(apart, scores, variance, ratio) < 1e-10


if __name__ == "__main__":
    main()
