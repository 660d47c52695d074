"""Scenes, typed. Made from openapi.yaml by generate.py (make scene-classes): change that, not this.

Every member may be left out (None): the daemon's default then holds, which the comment says. What is out of range the daemon refuses, naming
the member; `limits` tells ranges, for drawing scenes at random.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from stratus.members import Section, member


@dataclass(slots=True, kw_only=True)
class Sun(Section):
    """Elevation and azimuth, or time and place (all three, and then neither angle)."""

    # -18 to 90. default 35
    elevation_deg: float | None = member(limits=(-18, 90), default=35)
    # 0 to 360. default 140
    azimuth_deg: float | None = member(limits=(0, 360), default=140)
    # RFC 3339.
    time: str | None = member()
    # -90 to 90
    latitude_deg: float | None = member(limits=(-90, 90))
    # -180 to 180. East positive.
    longitude_deg: float | None = member(limits=(-180, 180))


@dataclass(slots=True, kw_only=True)
class Dsd(Section):
    """Modified gamma distribution of droplet radii, N(r) = N0 / (Gamma(gamma) rn) (r/rn)^(gamma-1) exp(-r/rn). Liquid water is at
    most 5 g/m3."""

    # 1 to 5000. default 300
    n0_per_cm3: float | None = member(limits=(1, 5000), default=300)
    # 1 to 20. default 2
    gamma: float | None = member(limits=(1, 20), default=2)
    # 1 to 30. default 7
    effective_radius_um: float | None = member(limits=(1, 30), default=7)
    # 0.045 to 10. rn, instead of the effective radius (gamma + 2) rn, which must be in its range.
    characteristic_radius_um: float | None = member(limits=(0.045, 10))


@dataclass(slots=True, kw_only=True)
class Clouds(Section):
    """The member clouds of a scene."""

    # default stratocumulus. A sheet; cells 1.4 km wide, open rings at low coverage; cells 0.4 km wide in rows, at home near
    # base_m 3000 with thickness_m 100; grains of 0.1 km, near base_m 7000 with thickness_m 50. Lengths are those of the type
    # whatever tile_m and resolution, as far as a texel allows.
    type: Literal['stratus', 'stratocumulus', 'altocumulus', 'cirrocumulus', 'none'] | None = member(default='stratocumulus')
    # 0 to 4294967295. default 1
    seed: int | None = member(limits=(0, 4294967295), default=1)
    # 0 to 10000000. default 0. Clouds drift with the wind, live and die; any time costs the same.
    time_s: float | None = member(limits=(0, 10000000), default=0)
    # 0 to 1. default 0.7. Share of the sky overhead that holds cloud.
    coverage: float | None = member(limits=(0, 1), default=0.7)
    # 100 to 12000. default 1200
    base_m: float | None = member(limits=(100, 12000), default=1200)
    # 0 to 2000. default 400. The thickest part.
    thickness_m: float | None = member(limits=(0, 2000), default=400)
    # 2000 to 200000. default 20000. Length of the field that is made. Beyond half of it from the camera the field goes on by
    # copies, sheared against each other so that no repeat shows; those of a map are not, and repeat after this length. What light
    # does between ground and clouds repeats with the tile.
    tile_m: float | None = member(limits=(2000, 200000), default=20000)
    # default 512
    resolution: Literal[64, 128, 256, 512, 1024, 2048, 4096] | None = member(default=512)
    # -100 to 100. default [8, 3]. Direction of motion, east and north.
    wind_mps: tuple[float, float] | None = member(limits=(-100, 100), default=[8, 3])
    # Name of an asset: thickness is its values (0 to 1; a PNG's codes as they are) times thickness_m, over a tile whose south-
    # west corner is at the origin, first row north, first column west. It is what it says: no detail is added, and time only lets
    # it drift. Then without type, seed and coverage.
    map: str | None = member()
    # What the map's content must be; the scene in a picture says it, so that rendering that again makes the same picture or none.
    map_hash: str | None = member()


@dataclass(slots=True, kw_only=True)
class Ground(Section):
    """The member ground of a scene."""

    # default country. Spectral reflectances are published ones. A sea mirrors sky, clouds and sun over waves that the clouds'
    # wind drives (wind_mps, within 2 to 15 m/s) and that move with time_s; its albedo goes by the height of the sun.
    type: Literal['grass', 'country', 'soil', 'sand', 'sea', 'sea_ice', 'snow', 'black', 'lambert'] | None = member(default='country')
    # 0 to 1. default [0.5, 0.5, 0.5]. Red, green, blue; of the type lambert only. Times albedo_scale at most 1.
    albedo: tuple[float, float, float] | None = member(limits=(0, 1), default=[0.5, 0.5, 0.5])
    # 0 to 2. default 1
    albedo_scale: float | None = member(limits=(0, 2), default=1)
    # Name of an asset: reflectance in linear Rec. 709 (a PNG's codes by the sRGB curve), laid out as the map of the clouds. Its
    # largest value times albedo_scale is at most 1. Then without type and albedo.
    map: str | None = member()
    # As that of the clouds.
    map_hash: str | None = member()


@dataclass(slots=True, kw_only=True)
class Atmosphere(Section):
    """The member atmosphere of a scene."""

    # 0 to 2. default 0.1. At 550 nm.
    aerosol_optical_depth: float | None = member(limits=(0, 2), default=0.1)
    # 0 to 600. default 300
    ozone_du: float | None = member(limits=(0, 600), default=300)


@dataclass(slots=True, kw_only=True)
class Camera(Section):
    """Not inside the cloud layer, but for the model reference."""

    # -1000000 to 1000000; -1000000 to 1000000; 0.1 to 30000. default [0, 0, 2]. East, north, above ground.
    position_m: tuple[float, float, float] | None = member(limits=[(-1000000, 1000000), (-1000000, 1000000), (0.1, 30000)], default=[0, 0, 2])
    # 0 to 360. default 140
    azimuth_deg: float | None = member(limits=(0, 360), default=140)
    # -90 to 90. default 20
    elevation_deg: float | None = member(limits=(-90, 90), default=20)
    # -180 to 180. default 0. Positive turns the image clockwise.
    roll_deg: float | None = member(limits=(-180, 180), default=0)
    # 0.5 to 150. default 60
    vertical_fov_deg: float | None = member(limits=(0.5, 150), default=60)
    # default perspective. The others are panoramas, and the members of the camera's direction and field of view are then refused.
    # fisheye: equidistant over the upper hemisphere, 1:1, the zenith in the middle, north up, so that east is on the left; black
    # outside of its circle, whose edge a PNG softens over a pixel. equirectangular: 2:1, azimuth/360 across from the left edge,
    # (90 - elevation)/180 down from the upper one: north at the left edge, south in the middle. cubemap: six faces of 90 degrees
    # stacked 1:6 in OpenEXR's order and orientation, +X (east), -X, +Y (up), -Y, +Z (south), -Z.
    projection: Literal['perspective', 'fisheye', 'equirectangular', 'cubemap'] | None = member(default='perspective')
    # Of a cubemap, this face alone, 1:1; all six when it is left out.
    face: Literal['+X', '-X', '+Y', '-Y', '+Z', '-Z'] | None = member()


@dataclass(slots=True, kw_only=True)
class Radiosity(Section):
    """Light that goes back and forth between ground and cloud base. `Server-Timing` says after how many passes it stopped, and with
    what residual."""

    # default True. false takes away the ground's light on the cloud base and what the base returns of it. The ground stays lit by
    # the beam, the sky and the light that comes through the clouds.
    enabled: bool | None = member(default=True)
    # 1e-06 to 1. default 0.001. The exchange stops when its residual is as small: light still on its way from the base to the
    # ground, root mean square over the tile, over the mean of all that the ground receives.
    tolerance: float | None = member(limits=(1e-06, 1), default=0.001)
    # 0 to 1024. default 64. Or after so many passes, each one bounce up and one down. 0 is the same as enabled false.
    max_passes: int | None = member(limits=(0, 1024), default=64)


@dataclass(slots=True, kw_only=True)
class Model(Section):
    """The member model of a scene."""

    # default slab. slab: in real time, each place of the layer as a plane-parallel slab. reference: the same scene by unbiased
    # Monte Carlo path tracing through the layer as a volume, in seconds to minutes; a judge of the other. It has no use for
    # shading and radiosity, which it leaves out of its canonical form: light between ground and clouds is always followed to its
    # end.
    name: Literal['slab', 'reference'] | None = member(default='slab')
    # default solved. solved: all orders of scattering of a plane-parallel layer of these droplets. paper: the model of Bouthors
    # et al. 2006, fitted to the same droplets.
    shading: Literal['solved', 'paper'] | None = member(default='solved')
    # default mie
    optics: Literal['mie', 'paper'] | None = member(default='mie')
    # 1 to 65536. default 64. Light paths per pixel. Of the model reference, as the next three; refused beside others. Times width
    # x height at most 1024 million, unless the daemon is told otherwise (`--reference-mpaths`).
    samples: int | None = member(limits=(1, 65536), default=64)
    # 0 to 600000. default 0. The paths end after so long, with fewer samples (`Stratus-Samples`); 0 is no such end. Such a
    # picture has no entity tag.
    time_budget_ms: float | None = member(limits=(0, 600000), default=0)
    # 0 to 4294967295. default 1. Of the random numbers. The same seed gives the same picture on the same device.
    seed: int | None = member(limits=(0, 4294967295), default=1)
    # default False. true: a picture that is not done when the deadline comes (`X-Timeout-Ms`) is answered 200 as it is then, with
    # `Stratus-Samples` and `Stratus-Partial`, instead of 504. Such a picture has no entity tag. The exception: while not every
    # pixel has its first sample, as with a deadline of a second or a large picture, there is no picture yet, and the answer is
    # 504 all the same.
    partial: bool | None = member(default=False)
    # Kinds of light that the picture shows, for looking at one effect alone; all unless given. Those left out are zero in color
    # and as layers. The light between clouds and ground, the exposure and the illuminances are those of all of them.
    paths: list[Literal['sun_direct', 'order0', 'order1', 'order2', 'multiple', 'cloud_sky', 'cloud_ground', 'sky', 'ground', 'air']] | None = member()


@dataclass(slots=True, kw_only=True)
class Output(Section):
    """Width x height x layers is at most 64 Mi pixels. A panorama has its own shape and default size: fisheye 1024 x 1024,
    equirectangular 2048 x 1024, cubemap 512 x 3072, one face of it 512 x 512. Of width and height one is enough, the other follows;
    another shape is refused."""

    # 16 to 8192. default 1024
    width: int | None = member(limits=(16, 8192), default=1024)
    # 16 to 8192. default 768
    height: int | None = member(limits=(16, 8192), default=768)
    # default png
    format: Literal['png', 'exr'] | None = member(default='png')
    # -20 to 20. default auto. Of a PNG: scene luminance is multiplied by 2^exposure_ev, where 1 is 1000 cd/m2 (a sunny day wants
    # about -4). "auto" depends on the illuminance of the scene alone, and on which side of a layer the camera is, never on the
    # picture.
    exposure_ev: float | Literal['auto'] | None = member(limits=(-20, 20), default='auto')
    # default filmic. Of a PNG. filmic is a film-like curve balanced for daylight of 5500 K, with a long shoulder on which warm
    # light far beyond white goes to a pale tint of its own hue; linear is colorimetric and clips at white.
    tone: Literal['filmic', 'linear'] | None = member(default='filmic')
    # default ['color']. Of an EXR; a PNG has color alone. Color is the sum of sun_direct to air. standard_error is that of color,
    # of the model reference alone.
    layers: list[Literal['color', 'sun_direct', 'order0', 'order1', 'order2', 'multiple', 'cloud_sky', 'cloud_ground', 'sky', 'ground', 'air', 'transmittance', 'optical_thickness', 'distance', 'standard_error']] | None = member(default=['color'])
    # default zip
    exr_compression: Literal['none', 'rle', 'zip', 'piz', 'dwaa'] | None = member(default='zip')
    # default auto. Of an EXR. auto chooses for each channel: half, but float where a value is beyond 65504 or where, as in deep
    # twilight, more than a hundredth of the values within twelve stops of the brightest are below 2^-14, where half is coarse.
    # half clamps to 65504.
    exr_type: Literal['auto', 'half', 'float'] | None = member(default='auto')
    # default fast
    png_compression: Literal['fast', 'small'] | None = member(default='fast')
    # default 8
    bits: Literal[8, 16] | None = member(default=8)


@dataclass(slots=True, kw_only=True)
class Scene(Section):
    """What is rendered. `Scene()` is the daemon's default sky."""

    sun: Sun = field(default_factory=Sun)
    dsd: Dsd = field(default_factory=Dsd)
    clouds: Clouds = field(default_factory=Clouds)
    ground: Ground = field(default_factory=Ground)
    atmosphere: Atmosphere = field(default_factory=Atmosphere)
    camera: Camera = field(default_factory=Camera)
    radiosity: Radiosity = field(default_factory=Radiosity)
    model: Model = field(default_factory=Model)
    output: Output = field(default_factory=Output)
