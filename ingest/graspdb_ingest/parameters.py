"""Everything that a user may tune, in one frozen object that is stored with each trial."""

import json
from dataclasses import asdict, dataclass, field
from typing import Final

from graspdb_schemas.errors import ParameterError, nearest

HAND_SURFACES: Final = ("spheres", "capsules", "skin")
"""Surfaces of a hand, each inside the next."""


@dataclass(frozen=True)
class CloudParameters:
    """How an object's surface becomes a point cloud.

    Attributes
    ----------
    spacing : float
        Distance between neighbouring points [m].
    smoothing_radius : float
        Radius within which the surface is smoothed before its points are described [m]; contact and hull
        see the cloud as it is.
    fpfh_radius : float
        Radius of the fast point feature histograms [m]; never scaled with the object.
    seed : int
        Seed of the sampling.
    """

    spacing: float = 0.002
    smoothing_radius: float = 0.008
    fpfh_radius: float = 0.020
    seed: int = 0


@dataclass(frozen=True)
class PoseParameters:
    """What an object's markers must be like to fix its pose.

    Attributes
    ----------
    minimum_spread : float
        Seen markers nearer than this to one line (root mean square) fix no rotation about it [m].
    outlier_distance : float
        A frame with a marker further than this from its fitted place is tried without each marker [m].
    outlier_ratio : float
        A marker is left out if the others then fit this many times better.
    maximum_residual : float
        Root mean square distance of the markers to their fitted places above which there is no pose [m].
    """

    minimum_spread: float = 0.002
    outlier_distance: float = 0.006
    outlier_ratio: float = 3.0
    maximum_residual: float = 0.02


@dataclass(frozen=True)
class TrackingParameters:
    """The hand tracker's model of markers and movement.

    Attributes
    ----------
    marker_sd : float
        Standard deviation of a marker about its place on the model, noise and skin movement [m].
    gate : float
        Probability that a true marker passes the Mahalanobis gate.
    posture_time : float
        Time scale of joint angles about the mean posture [s].
    translation_acceleration : float
        Spread of the forearm's acceleration, root of its spectral density [m/s^1.5].
    rotation_acceleration : float
        The same for its rotation [rad/s^1.5].
    minimum_start_markers : int
        Markers that a frame needs to start from.
    minimum_tracked : float
        Share of the frames in which the hand must be known; a trial with less is rejected.
    maximum_residual : float
        A trial whose median marker residual is above this is rejected [m].
    maximum_rejected : float
        Share of the seen markers that may be left out as faulty; with more a trial is rejected.
    uncertain_sd : float
        A frame whose median standard deviation of the sites is above this is uncertain [m].
    maximum_uncertain : float
        Share of the tracked frames that may be uncertain; with more a trial is rejected.
    """

    marker_sd: float = 0.0015
    gate: float = 0.9999
    posture_time: float = 0.25
    translation_acceleration: float = 5.0
    rotation_acceleration: float = 30.0
    minimum_start_markers: int = 6
    minimum_tracked: float = 0.5
    maximum_residual: float = 0.010
    maximum_rejected: float = 0.25
    uncertain_sd: float = 0.02
    maximum_uncertain: float = 0.5


@dataclass(frozen=True)
class EventParameters:
    """Thresholds that find holds and lifts.

    Attributes
    ----------
    rest_speed : float
        An object whose height changes slower than this is at rest [m/s].
    minimum_rest : float
        Shortest rest that a lift can start from, and shortest time that a lifted object stays
        raised [s]; a turning point of a path and a spike of noise are shorter.
    lift_height : float
        An object raised by more than this has been lifted [m].
    minimum_hold : float
        Shortest time with `minimum_sites` in contact that is a hold [s].
    minimum_gap : float
        Holds nearer to each other than this are one [s].
    maximum_unknown : float
        A hold outlasts data missing for no longer than this, if there is contact after it [s].
    minimum_sites : int
        Sites in contact that make a hold.
    release_margin : float
        A touching sphere is released when its gap exceeds h by more than this [m].
    steady_contacts : float
        Share of a hold's largest number of touching sites that its steadiest frame must have.
    smoothing : float
        Cut-off of the low-pass filter on the paths of object and hand [Hz].
    minimum_contact : float
        Shortest contact of a site that is an event, and shortest time without contact that ends one [s].
    """

    rest_speed: float = 0.015
    minimum_rest: float = 0.1
    lift_height: float = 0.005
    minimum_hold: float = 0.15
    minimum_gap: float = 0.15
    maximum_unknown: float = 1.0
    minimum_sites: int = 2
    release_margin: float = 0.004
    steady_contacts: float = 0.8
    smoothing: float = 6.0
    minimum_contact: float = 0.05


@dataclass(frozen=True)
class ContactParameters:
    """Contact and enclosing space.

    Attributes
    ----------
    threshold : float
        h of equation 3 [m].
    sphere_vertices : int
        Vertices that stand for a sphere in the hull; the paper has 64.
    surface : str
        Surface of the hand whose gaps are taken: ``spheres``, ``capsules`` or ``skin``.
    map_reach : float
        Object points up to this far from the hand's surface are in the contact map [m].

    Raises
    ------
    ParameterError
        If there is no such surface.
    """

    threshold: float = 0.004
    sphere_vertices: int = 64
    surface: str = "spheres"
    map_reach: float = 0.02

    def __post_init__(self) -> None:
        if self.surface not in HAND_SURFACES:
            hint = nearest(self.surface, HAND_SURFACES)
            raise ParameterError("contact.surface", self.surface, f"one of {', '.join(HAND_SURFACES)}{hint}")


@dataclass(frozen=True)
class GloveParameters:
    """What is taken of a data glove, and how it is compared with the markers.

    Attributes
    ----------
    known_sd : float
        A joint counts as shown by the markers where its standard deviation is below this [rad].
    usual_sd, offset_sd : float
        Standard deviation of a sample, and of a sensor's offset, before any comparison [rad].
    minimum_sd : float
        No sensor is taken to be better than this [rad].
    maximum_sd : float
        A sensor that differs from the markers by more than this is left out [rad].
    longest_delay : float
        Largest difference of the two clocks that is looked for [s].
    memory : float
        Time over which the filter averages a joint's samples [s].
    """

    known_sd: float = 0.1
    usual_sd: float = 0.09
    offset_sd: float = 0.17
    minimum_sd: float = 0.01
    maximum_sd: float = 0.35
    longest_delay: float = 0.25
    memory: float = 0.25


@dataclass(frozen=True)
class QualityParameters:
    """Grasp quality.

    Attributes
    ----------
    friction : float
        Coefficient of friction of an object whose manifest gives none: that of palmar skin on vinyl, 0.50
        and 0.53 in 84 measurements (Buchholz, Frederick and Armstrong 1988, Ergonomics 31, 317).
    cone_edges : int
        Edges of the pyramid inscribed in each friction cone.
    """

    friction: float = 0.5
    cone_edges: int = 6


@dataclass(frozen=True)
class RegistrationParameters:
    """When a depth camera's cloud tells the pose of an object.

    Attributes
    ----------
    reach : float
        Points of the cloud further than this from the model are not the object's [m].
    minimum_fitness : float
        Share of the points within reach that have to lie within three times the noise of the fit.
    maximum_residual : float
        Root mean square distance of these to the model's surface, above which there is no pose [m].
    maximum_gap : float
        Frames between clouds further apart than this have no pose [s].
    """

    reach: float = 0.02
    minimum_fitness: float = 0.5
    maximum_residual: float = 0.01
    maximum_gap: float = 0.15


@dataclass(frozen=True)
class IngestParameters:
    """All parameters of an ingest."""

    cloud: CloudParameters = field(default_factory=CloudParameters)
    pose: PoseParameters = field(default_factory=PoseParameters)
    tracking: TrackingParameters = field(default_factory=TrackingParameters)
    events: EventParameters = field(default_factory=EventParameters)
    contact: ContactParameters = field(default_factory=ContactParameters)
    glove: GloveParameters = field(default_factory=GloveParameters)
    quality: QualityParameters = field(default_factory=QualityParameters)
    registration: RegistrationParameters = field(default_factory=RegistrationParameters)

    def to_json(self) -> str:
        """Return the parameters as JSON with sorted keys."""
        return json.dumps(asdict(self), sort_keys=True)
