"""The columns of every table. Units and frames are in the names; poses are 4×4 matrices, row by row."""

import pyarrow as pa

_POINT = [(name, pa.float64()) for name in ("x_m", "y_m", "z_m", "nx", "ny", "nz")]
_SAMPLE = [("area_m2", pa.float64()), ("seen", pa.bool_())]
_PARTS = [(name, pa.bool_()) for name in ("container", "rim", "handle")]
_POSE = pa.list_(pa.float64(), 16)


def _floats(*names: str) -> list[tuple[str, pa.DataType]]:
    return [(name, pa.float64()) for name in names]


def _integers(*names: str) -> list[tuple[str, pa.DataType]]:
    return [(name, pa.int64()) for name in names]


def _strings(*names: str) -> list[tuple[str, pa.DataType]]:
    return [(name, pa.string()) for name in names]


_CURVE = _strings("experiment", "features", "split", "training_object") + _integers("draw")
_MEASURES = ("auc", "partial_auc", "tpr_at_fpr_00", "tpr_at_fpr_01", "tpr_at_fpr_05", "brier")

_EXECUTION = _strings("held_object", "target_object", "features") + _integers("draw")
_COUNTS = _integers("n_balls", "n_poured", "n_in_target", "n_spilled", "n_overflowed", "n_early", "n_leaked")

TABLES = {
    # Points that a human labelled, in the frame of the scan (world).
    "annotation": pa.schema(_floats("x_m", "y_m", "z_m") + _PARTS),
    # Uniform points on the true surface of a demonstration object, its own frame; `inner`: faces the cavity.
    "truth": pa.schema([*_POINT, *_PARTS, ("inner", pa.bool_())]),
    # Uniform points on the fused surface, object frame; `seen`: by a camera (the closed underside is not).
    "cloud": pa.schema([*_POINT, *_SAMPLE]),
    # The same points with the initial estimate of their parts.
    "labels": pa.schema([*_POINT, *_SAMPLE, *_floats("p_container", "p_rim", "p_handle"), *_PARTS]),
    # Warped points in the target's object frame; indices are rows of the source's and the target's cloud. The area is
    # that of the surface around a point, after the warp.
    "mapping": pa.schema(
        [
            *_POINT,
            ("area_m2", pa.float64()),
            *_PARTS,
            *_integers("source_index", "target_index"),
            ("valid", pa.bool_()),
        ]
    ),
    # Warped parameters, one row an (object, mapping); the lip is that of the cup alone.
    "parameters": pa.schema(
        _strings("object", "mapping")
        + _floats(
            *("radius_m", "volume_m3", "height_m", "tilt_reference_rad", "capacity_m3"),
            *("tilt_reference_cavity_rad", "wall_m"),
            *("opening_x_m", "opening_y_m", "opening_z_m", "lip_x_m", "lip_y_m", "lip_z_m"),
            *("centre_x_m", "centre_y_m", "centre_z_m"),
        )
    ),
    # Every parameter of `parametrise.parameters`, a row a number: its value, its standard deviation over redrawn clouds.
    "uncertainties": pa.schema(
        _strings("object", "mapping", "parameter") + _floats("value", "std") + _strings("unit")
    ),
    # The tilt reference with the lip at each rim point, object frame.
    "tilt_references": pa.schema(
        _strings("object", "mapping") + _floats("x_m", "y_m", "z_m", "tilt_reference_rad")
    ),
    # Trials. Lip: held object's frame. Tilt axis: world. Poses: before tilting. dx along the pour, dy across, dz up,
    # lip relative to the centre of the second's opening. Filling alone: second_fill_m3, d*_m, T_world_second.
    # `half`: how the second was filled (filling) or `capacity` (pouring).
    "trials": pa.schema(
        _integers("trial", "seed")
        + _strings("experiment", "object", "held_object", "half")
        + _floats("fill_m3", "second_fill_m3", "tilt_rad", "lip_x_m", "lip_y_m", "lip_z_m")
        + _floats("axis_x", "axis_y", "axis_z", "dx_m", "dy_m", "dz_m")
        + [("T_world_held", _POSE), ("T_world_second", _POSE)]
        + _integers("n_particles", "n_second", "n_left", "n_retained", "n_spilled", "n_leaked", "n_void")
        + _floats("density_error", "hydrostatic_margin")
        + [("poured", pa.bool_()), ("filled", pa.bool_()), ("failed", pa.bool_())]
    ),
    # Pours that a primitive was learnt from, at aligned phases, divided by its features' references (standard: metres, radians).
    "demonstrations": pa.schema(_integers("pour") + _floats("phase", "x", "y", "z", "tilt")),
    # What the arm did, 60 poses a second. World: the table's top is z = 0, the opening's centre over the origin, the pour along
    # +x; the second container stands upright at second_x_m, second_y_m. lip_*_m, tilt_rad: the held cup's own lip relative to the
    # centre of the second's own opening.
    "trajectories": pa.schema(
        [*_EXECUTION, *_floats("t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw")]
        + _floats("lip_x_m", "lip_y_m", "lip_z_m", "tilt_rad", "second_x_m", "second_y_m")
    ),
    # Samples of a draw, in order, until the arm could follow one: why not (empty: it did), and how far from the plan its lip was.
    "attempts": pa.schema(
        [*_EXECUTION, *_integers("attempt"), *_strings("refused"), *_floats("duration_s", "off_plan_m")]
    ),
    # What was poured along the arm's poses. poured: left the cup; of the spilled: overflowed or early, or aimed badly.
    "carried": pa.schema(
        [*_EXECUTION, *_COUNTS, *_floats("first_drop_s", "first_spill_s"), ("failed", pa.bool_())]
    ),
    # Both together, with the verdict: cause is arm, early_pour, overflow, aim, lip, leak, or empty when it succeeded.
    "executions": pa.schema(
        [
            *_strings("source"),
            *_EXECUTION,
            *_integers("n_refused"),
            *_COUNTS,
            *_floats("first_drop_s", "first_spill_s"),
        ]
        + _floats("duration_s", "off_plan_m", "fill_m3", "target_capacity_m3")
        + [("fits", pa.bool_()), ("success", pa.bool_()), *_strings("cause", "refused")]
    ),
    # Shares of trajectories drawn from a primitive that tilt beyond the tilt reference while the lip is outside the opening: before
    # it has come inside for the first time (way_in), at any time (ever).
    "safety": pa.schema(
        _strings("held_object", "target_object", "features")
        + _integers("samples")
        + _floats("way_in", "ever")
    ),
    # Checks of the liquid; what x, measured and expected are is said at each check (simulate.measures, .convergence).
    "physics": pa.schema(
        _strings("check", "vessel")
        + _floats("spacing_m")
        + _integers("n_particles")
        + _floats("x", "measured", "expected")
    ),
    # One row a tested trial of a classifier; `trial` counts within `test_object`.
    "predictions": pa.schema(
        [
            *((name, pa.dictionary(pa.int8(), pa.string())) for name in ("experiment", "features", "split")),
            *((name, pa.dictionary(pa.int8(), pa.string())) for name in ("training_object", "test_object")),
            ("draw", pa.int16()),
            ("trial", pa.int16()),
            ("probability", pa.float32()),
            ("label", pa.bool_()),
        ]
    ),
    # One row a classifier and split; features `hydrostatic` is the ceiling (no training, draw 0).
    "scores": pa.schema(
        _CURVE
        + _floats("auc", "tpr_at_fpr_00", "tpr_at_fpr_01", "tpr_at_fpr_05", "brier")
        + _integers("n_test", "n_positive", "n_iterations", "n_redrawn")
        + [("separable", pa.bool_()), ("converged", pa.bool_())]
    ),
    # Bootstrap over objects: a row a mean over classifiers; replicate 0 has each object once (statistics.resampling).
    "replicates": pa.schema(
        _strings("experiment", "features", "split") + _integers("samples", "replicate") + _floats(*_MEASURES)
    ),
    # The same for several numbers of samples, and how the fits of that many went.
    "learning": pa.schema(
        _strings("experiment", "features", "split")
        + _integers("samples", "replicate")
        + _floats(*_MEASURES, "separable_share", "converged_share")
        + _integers("n_redrawn")
    ),
    # Classifiers of one object tested on one object, means over draws.
    "pairs": pa.schema(
        _strings("experiment", "features", "split", "training_object", "test_object")
        + _integers("samples")
        + _floats(*_MEASURES)
    ),
    # ROC curves at fixed false positive rates.
    "curves": pa.schema(_CURVE + _floats("fpr", "tpr")),
}
