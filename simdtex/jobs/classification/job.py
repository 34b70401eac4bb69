# SPDX-License-Identifier: BSD-3-Clause
"""Classification of the textures in a picture: `classify`, and `TextureClassifier`, which is trained once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simdtex.driver import Device, Kept, Seed, drive, run
from simdtex.inputs import check_mask, check_picture, is_several
from simdtex.jobs.classification.algorithm import Classification
from simdtex.jobs.classification.model import BANDS, CLASSES, FEWEST_NEIGHBOURHOODS, Model, Region, learn
from simdtex.jobs.classification.options import Options
from simdtex.machine import Machine, open_machine
from simdtex.model.pictures import Mask, check_alike, completed
from simdtex.options import real_array, resolve, table
from simdtex.random import as_seed
from simdtex.run import Callback


def classify(
    image: ArrayLike,
    textures: Mapping[str, ArrayLike | Sequence[ArrayLike]] | ArrayLike,
    *,
    masks: Mapping[str, Any] | None = None,
    validation: Mapping[str, ArrayLike | Sequence[ArrayLike]] | None = None,
    channel_axis: int | None = None,
    rng: Seed = None,
    device: Device = None,
    callback: Callback | None = None,
    checkpoint: Kept = None,
    full_output: bool = False,
    **options: Any,
) -> Any:
    """Return a label for each pixel of a picture: the texture around it, or unknown.

    Parameters
    ----------
    image : (rows, cols) or, with `channel_axis`, (rows, cols, bands) array
        The picture; any real type, up to 14 bands. Pixels that are NaN or masked get the label 0.
    textures : mapping of str to array or list of arrays, or (rows, cols) array of integers
        The samples of each class, of the picture's type, by the name of the class. Or training regions of the picture
        itself: 1, 2, ... where a pixel is of a class, and 0 elsewhere.
    masks : mapping of str to (rows, cols) bool array or list of arrays, optional
        True for pixels of the samples that may be used; a class without masks is used whole.
    validation : mapping of str to array or list of arrays, optional
        Further pictures of a class, from which no exemplars are drawn. They measure how much the class varies, which
        decides when a pixel is unknown.
    channel_axis : int, optional
        The axis of pictures that holds channels; None for grey pictures.
    rng : int or numpy.random.Generator, optional
        The seed: the same one gives the same bytes on every device. None draws one at random.
    device : str or Machine, optional
        Part of a name, index of ``simdtex devices``, or ``"reference"``. None: SIMDTEX_DEVICE, else a GPU, else a CPU.
    callback : callable, optional
        Called several times a second with a `simdtex.run.Progress`; an error that it raises ends the run.
    checkpoint : path or simdtex.Checkpoint, optional
        Keep the state of the run in this file, from which the same call continues it; removed when the run has ended.
    full_output : bool
        Return a `simdtex.run.Output` too.
    **options
        See `simdtex.jobs.classification.options.Options`.

    Returns
    -------
    labels : (rows, cols) uint8 array
        0 for unknown textures, 1 for the first class, 2 for the second... With training regions, their numbers.
    output : simdtex.run.Output
        Only with ``full_output=True``; it has ``fit`` and ``probability``.

    Raises
    ------
    ValueError, TypeError
        An argument is invalid; the message names the remedy.

    Notes
    -----
    Equation (6) with the bandwidth of the nearest neighbour, of whole neighbourhoods, at up to three levels, raw and
    with compressed contrast; frequencies of binary patterns in small windows; a Potts field of labels; and a test of
    distances and binary patterns: see ``docs/classification.rst``. The labels are the same on every device. A turned,
    enlarged or differently lit texture is another texture, and strips narrower than the coupling vanish.

    Cost: pixels x exemplars x classes x 66 multiply-adds for each band, and pixels x classes x 7000 multiply-adds for
    the fit; 512x512 pixels and five classes take some 10 s of one core. Memory: 48 bytes for each pixel and class, 100
    for each pixel, and 200 MB.

    Examples
    --------
    >>> from skimage import data
    >>> import numpy as np, simdtex
    >>> brick, grass = data.brick(), data.grass()
    >>> picture = np.hstack([brick[-64:, -64:], grass[-64:, -64:]])
    >>> labels = simdtex.classify(picture, {"brick": brick[:64, :64], "grass": grass[:64, :64]}, rng=1, unknown=0)
    >>> float((labels == np.repeat([1, 2], 64)).mean()) > 0.95
    True
    """
    job = plan_classification(image, textures, masks or {}, validation or {}, channel_axis, **options)
    labels, output = run("classify", job, rng, device, callback, checkpoint)
    return (labels, output) if full_output else labels


def plan_classification(
    image: Any, textures: Any, masks: Any, validation: Any, channel_axis: int | None, **options: Any
) -> Classification:
    """Check the arguments of `classify`, and return its job."""
    pixels, unknown = check_picture(image, channel_axis)
    chosen = resolve(Options, "classify", options, classify)
    if isinstance(textures, Mapping):
        classes = _sampled(textures, masks, validation, pixels, channel_axis)
        names = dict(enumerate(textures, 1))
    elif masks or validation:
        raise ValueError("masks and validation belong to samples by name; leave them out with training regions")
    else:
        painted = _painted([(pixels, unknown, textures)])
        names, classes = {label: str(label) for label in painted}, list(painted.values())
    return Classification(completed(pixels, unknown), unknown, classes, names, chosen)


def _sampled(
    textures: Any, masks: Any, validation: Any, like: NDArray[Any], channel_axis: int | None
) -> list[list[Region]]:
    """Return the regions of each class."""
    for what, named in (("masks", masks), ("validation", validation)):
        if strange := [name for name in named if name not in textures]:
            raise ValueError(f"{what} name the class {strange[0]!r}, which textures do not; choose of {list(textures)}")
    _check_count(len(textures), like.shape[-1])
    classes = []
    for name in textures:
        if not isinstance(name, str) or not name or name == "unknown":
            raise ValueError(f"{name!r} is no name of a class; give a text other than 'unknown'")
        shown = _listed(textures[name], channel_axis)
        usable = masks.get(name)
        limits = [None] * len(shown) if usable is None else usable if isinstance(usable, (list, tuple)) else [usable]
        if len(limits) != len(shown):
            raise ValueError(f"class {name!r} has {len(shown)} samples and {len(limits)} masks; give one for each")
        regions = [_region(name, one, limit, like, channel_axis) for one, limit in zip(shown, limits, strict=True)]
        held = _listed(validation[name], channel_axis) if name in validation else []
        regions += [_region(name, sample, None, like, channel_axis)._replace(judged=True) for sample in held]
        classes.append(regions)
    return classes


def _listed(samples: Any, channel_axis: int | None) -> list[Any]:
    return list(samples) if is_several(samples, channel_axis) else [samples]


def _region(name: str, sample: Any, mask: Any, like: NDArray[Any], channel_axis: int | None) -> Region:
    """Return a sample of a class as a region, of the type of the picture."""
    try:
        pixels, unknown = check_picture(sample, channel_axis)
        sites: Mask = ~unknown if mask is None else check_mask(mask, pixels.shape[:2]) & ~unknown
    except (ValueError, TypeError) as error:
        raise type(error)(f"class {name!r}: {error}") from None
    check_alike(f"class {name!r}", pixels, "the picture", like)
    if not sites.any():
        raise ValueError(f"class {name!r} has a sample without a known pixel; leave it out")
    return Region(completed(pixels, unknown), sites)


def _painted(painted: Sequence[tuple[NDArray[Any], Mask, Any]]) -> dict[int, list[Region]]:
    """Return the regions of each painted label, in ascending order; ``painted`` holds (pixels, unknown, labels)."""
    regions: dict[int, list[Region]] = {}
    for pixels, unknown, labels in painted:
        numbers = real_array("the training regions", labels)
        if numbers.dtype.kind not in "bui" or numbers.shape != pixels.shape[:2]:
            raise ValueError(
                f"the training regions are {numbers.dtype} of shape {numbers.shape}; give integers of the shape "
                f"{pixels.shape[:2]} of the picture, 0 where nothing is painted"
            )
        if numbers.size and numbers.min() < 0:
            raise ValueError(f"the training regions have the label {numbers.min()}; give 0 or more")
        if numbers.size and numbers.max() > CLASSES:
            raise ValueError(f"the training regions have the label {numbers.max()}; give {CLASSES} at most")
        for label in np.unique(numbers[(numbers > 0) & ~unknown]).tolist():
            sites = (numbers == label) & ~unknown
            regions.setdefault(label, []).append(Region(completed(pixels, unknown), sites, whole=False))
    _check_count(len(regions), painted[0][0].shape[-1])
    by_label = dict(sorted(regions.items()))
    for label, shown in by_label.items():
        if (count := sum(int(region.sites.sum()) for region in shown)) < FEWEST_NEIGHBOURHOODS:
            raise ValueError(f"label {label} is painted on {count} pixels; paint {FEWEST_NEIGHBOURHOODS} or more")
    return by_label


def _check_count(count: int, bands: int) -> None:
    if not 1 <= count <= CLASSES:
        raise ValueError(f"there are {count} classes; give 1 to {CLASSES}")
    if bands > BANDS:
        raise ValueError(f"the picture has {bands} bands; give {BANDS} at most, say its principal components")


PARAMETERS = ("channel_axis", "rng", "device", *table(Options))
"""The arguments of `TextureClassifier`."""


class TextureClassifier:
    """A classifier that is trained once, by the conventions of scikit-learn.

    Parameters
    ----------
    channel_axis : int, optional
        The axis of pictures that holds bands; None for grey ones.
    rng : int or numpy.random.Generator, optional
        The seed: the same one gives the same bytes on every device. None draws one at random.
    device : str or Machine, optional
        Part of a name, index of ``simdtex devices``, or ``"reference"``. None: SIMDTEX_DEVICE, else a GPU, else a CPU.
    **options
        See `simdtex.jobs.classification.options.Options`.

    Attributes
    ----------
    classes_ : (classes,) array
        The labels that `fit` was given, in ascending order.

    Notes
    -----
    scikit-learn takes it as a classifier of pictures. A trained classifier can be copied, pickled, and dumped by joblib
    of the same version of simdtex, without the open device: an open machine as `device` becomes its name.

    Examples
    --------
    >>> from skimage import data
    >>> import numpy as np, simdtex
    >>> picture = np.hstack([data.brick()[:80, :80], data.gravel()[:80, :80]])
    >>> strokes = np.zeros(picture.shape, int)
    >>> strokes[20:60, 20:40], strokes[20:60, 120:140] = 1, 2
    >>> found = simdtex.TextureClassifier(unknown=0).fit(picture, strokes).predict(picture)
    >>> float((found == np.repeat([1, 2], 80)).mean()) > 0.95
    True
    """

    _machine: Machine | None = None

    def __init__(
        self, *, channel_axis: int | None = None, rng: Seed = 0, device: Device = None, **options: Any
    ) -> None:
        self.channel_axis, self.rng, self.device = channel_axis, rng, device
        self.set_params(**{**vars(resolve(Options, "classify", {})), **options})

    def __repr__(self) -> str:
        usual = type(self)().get_params()
        changed = [f"{name}={value!r}" for name, value in self.get_params().items() if repr(value) != repr(usual[name])]
        return f"{type(self).__name__}({', '.join(changed)})"

    def __getstate__(self) -> dict[str, Any]:
        device: Any = self.device
        if kind := getattr(device, "kind", None):
            device = "reference" if kind == "reference" else getattr(device, "info", device).name
        return vars(self) | {"device": device, "_machine": None}

    def __sklearn_clone__(self) -> Self:
        parameters = {name: value if name == "device" else deepcopy(value) for name, value in self.get_params().items()}
        return type(self)(**parameters)

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import ClassifierTags, InputTags, Tags, TargetTags

        shape = InputTags(two_d_array=False, three_d_array=True, allow_nan=True)
        return Tags("classifier", TargetTags(required=True), classifier_tags=ClassifierTags(), input_tags=shape)

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the arguments of the constructor, with all options; ``deep`` makes no difference."""
        return {name: vars(self)[name] for name in PARAMETERS}

    def set_params(self, **parameters: Any) -> Self:
        """Set arguments of the constructor, and return the classifier; its training is unchanged until `fit`."""
        for name in parameters:
            if name not in PARAMETERS:
                raise ValueError(f"TextureClassifier has no parameter {name!r}; choose from: {', '.join(PARAMETERS)}")
        vars(self).update(parameters)
        return self

    def fit(self, image: ArrayLike | Sequence[ArrayLike], labels: Any) -> Self:
        """Learn classes from training regions, and return the classifier.

        Parameters
        ----------
        image : array, or list of arrays
            Pictures of one type, as in `classify`.
        labels : (rows, cols) array of integers, or list of arrays
            For each picture the class of each pixel, 1 or more, and 0 elsewhere.

        Raises
        ------
        ValueError, TypeError
            As in `classify`; a label needs 16 pixels.
        """
        several = is_several(image, self.channel_axis)
        images: list[Any] = list(image) if several else [image]  # type: ignore[arg-type]
        painted = list(labels) if several else [labels]
        if len(images) != len(painted):
            raise ValueError(f"there are {len(images)} pictures and {len(painted)} of labels; give one for each")
        shown = [check_picture(one, self.channel_axis) for one in images]
        for n, (pixels, _) in enumerate(shown):
            check_alike(f"picture {n}", pixels, "picture 0", shown[0][0])
        taught = _painted([(*one, marked) for one, marked in zip(shown, painted, strict=True)])
        self.classes_ = np.array(list(taught))
        self.n_features_in_ = shown[0][0].shape[-1]
        self._like = shown[0][0][:1, :1].copy()
        self._chosen = resolve(Options, "classify", {name: vars(self)[name] for name in table(Options)})
        self._seed, machine = as_seed(self.rng), open_machine(self.device)
        self._names = {label: str(label) for label in taught}
        names = list(self._names.values())
        self._model: Model = learn(machine, list(taught.values()), names, self._chosen, self._seed)
        self._machine = machine
        return self

    def predict(self, image: ArrayLike) -> NDArray[Any]:
        """Return the label of each pixel of a picture, (rows, cols), 0 where the texture is unknown."""
        return self._run(image)[0]

    def predict_proba(self, image: ArrayLike) -> NDArray[np.float32]:
        """Return the probability of each class at each pixel, (rows, cols, classes), as `Output.probability`."""
        return np.asarray(self._run(image)[1].probability)

    def predict_fit(self, image: ArrayLike) -> NDArray[np.float32]:
        """Return how well each class fits each pixel, (rows, cols, classes), as `Output.fit`."""
        return np.asarray(self._run(image)[1].fit)

    def _run(self, image: ArrayLike) -> tuple[NDArray[np.uint8], Any]:
        if not hasattr(self, "_model"):
            raise ValueError("the classifier is not trained; call fit first")
        pixels, unknown = check_picture(image, self.channel_axis)
        check_alike("the picture", pixels, "that of training", self._like)
        plan = Classification(completed(pixels, unknown), unknown, self._model, self._names, self._chosen)
        self._machine = self._machine or open_machine(self.device)
        labels, output = drive(plan, self._machine, self._seed)
        return labels[..., 0], output
