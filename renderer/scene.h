/* The scene: everything a request may say, as one plain C tree.
 *
 * The server makes scenes out of JSON, the renderer only reads them. All members are values, in the units of their names (SI and degrees
 * where the name says nothing else); the two maps alone are held by whoever made the scene for as long as it is rendered. A scene that
 * reached the renderer has been validated: every number lies in the range given here and is finite.
 *
 * Axes: x east, y north, z up, metres. Azimuth: degrees clockwise from north. Elevation: degrees above the horizon, unrefracted.
 */
#ifndef STRATUS_RENDERER_SCENE_H
#define STRATUS_RENDERER_SCENE_H

#include <stdbool.h>
#include <stdint.h>

enum { SCENE_NAME_MAX = 64, SCENE_HASH_SIZE = 33 };

struct scene_map;

/* A picture over the tile, by its name and what that holds now. */
struct scene_map_choice {
	char name[SCENE_NAME_MAX];   /* "": none */
	char hash[SCENE_HASH_SIZE];  /* of the content, in hexadecimal */
	const struct scene_map *map; /* what the renderer goes by; NULL: none */
};

enum cloud_type { CLOUD_STRATUS, CLOUD_STRATOCUMULUS, CLOUD_ALTOCUMULUS, CLOUD_CIRROCUMULUS, CLOUD_NONE, CLOUD_TYPE_COUNT };

enum ground_type {
	GROUND_GRASS,
	GROUND_COUNTRY,
	GROUND_SOIL,
	GROUND_SAND,
	GROUND_SEA,
	GROUND_SEA_ICE,
	GROUND_SNOW,
	GROUND_BLACK,
	GROUND_LAMBERT,
	GROUND_TYPE_COUNT
};

enum projection { PROJECTION_PERSPECTIVE, PROJECTION_FISHEYE, PROJECTION_EQUIRECTANGULAR, PROJECTION_CUBEMAP, PROJECTION_COUNT };

/* Faces of a cubemap in OpenEXR's order; its axes are +X east, +Y up, +Z south. */
enum cube_face { FACE_POS_X, FACE_NEG_X, FACE_POS_Y, FACE_NEG_Y, FACE_POS_Z, FACE_NEG_Z, FACE_ALL, FACE_COUNT };

enum model_name { MODEL_SLAB, MODEL_REFERENCE, MODEL_VOLUME, MODEL_PLANAR, MODEL_COUNT };
enum shading { SHADING_SOLVED, SHADING_PAPER, SHADING_COUNT };
enum optics_model { OPTICS_MIE, OPTICS_PAPER, OPTICS_MODEL_COUNT };
enum image_format { IMAGE_PNG, IMAGE_EXR, IMAGE_FORMAT_COUNT };
enum tone { TONE_FILMIC, TONE_LINEAR, TONE_COUNT };
enum png_compression { PNG_FAST, PNG_SMALL, PNG_COMPRESSION_COUNT };
enum exr_compression { EXR_NONE, EXR_RLE, EXR_ZIP, EXR_PIZ, EXR_DWAA, EXR_COMPRESSION_COUNT };
enum exr_type { EXR_AUTO, EXR_HALF, EXR_FLOAT, EXR_TYPE_COUNT };

/* Layers of an EXR. LAYER_COLOR is the sum of LAYER_SUN_DIRECT .. LAYER_AIR, each already attenuated to the camera. */
enum layer {
	LAYER_COLOR,
	LAYER_SUN_DIRECT,
	LAYER_ORDER0,
	LAYER_ORDER1,
	LAYER_ORDER2,
	LAYER_MULTIPLE,
	LAYER_CLOUD_SKY,
	LAYER_CLOUD_GROUND,
	LAYER_SKY,
	LAYER_GROUND,
	LAYER_AIR,
	LAYER_TRANSMITTANCE,
	LAYER_OPTICAL_THICKNESS,
	LAYER_DISTANCE,
	LAYER_STANDARD_ERROR, /* of LAYER_COLOR; of MODEL_REFERENCE alone */
	LAYER_COUNT
};

/* Where the sun stands; where by_time is set, because of time and place, which no stage looks at: they go into files. */
struct scene_sun {
	double elevation_deg; /* -18..90 */
	double azimuth_deg;   /* 0..360 */
	bool by_time;
	double julian_day;    /* universal time */
	double latitude_deg;  /* -90..90, north */
	double longitude_deg; /* -180..180, east */
};

/* Modified gamma droplet size distribution, N(r) = N0 / (Gamma(gamma) rn) (r/rn)^(gamma-1) exp(-r/rn), re = (gamma + 2) rn. */
struct scene_dsd {
	double n0_per_cm3;          /* 1..5000 */
	double gamma;               /* 1..20 */
	double effective_radius_um; /* 1..30 */
};

struct scene_clouds {
	enum cloud_type type;
	uint32_t seed;
	double time_s;               /* 0..1e7 */
	double coverage;             /* 0..1 */
	double base_m;               /* 100..12000, above ground */
	double thickness_m;          /* 0..2000, the maximum of H */
	double tile_m;               /* 2000..200000 */
	int resolution;              /* 64..4096, a power of two */
	double wind_mps[2];          /* direction of motion east, north; each within 100 */
	struct scene_map_choice map; /* share of thickness_m, in place of type, seed and coverage */
};

struct scene_ground {
	enum ground_type type;
	double albedo[3];            /* 0..1 in Rec.709 red, green, blue; used by GROUND_LAMBERT alone */
	double albedo_scale;         /* 0..2, the product with the albedo never above 1 */
	struct scene_map_choice map; /* reflectance, in place of type and albedo; the type is then GROUND_LAMBERT */
};

struct scene_atmosphere {
	double aerosol_optical_depth; /* 0..2, at 550 nm */
	double ozone_du;              /* 0..600 */
};

struct scene_camera {
	double position_m[3];    /* x, y within 1e6; z 0.1..30000 above ground */
	double azimuth_deg;      /* 0..360; this and the next three of perspectives alone */
	double elevation_deg;    /* -90..90 */
	double roll_deg;         /* -180..180, positive turns the image clockwise */
	double vertical_fov_deg; /* 0.5..150 */
	enum projection projection;
	enum cube_face face; /* of a cubemap; FACE_ALL: the six of them stacked */
};

struct scene_radiosity {
	bool enabled;
	double tolerance; /* residual to stop at (renderer/stages/radiosity_solve.h); 1e-6..1 */
	int max_passes;   /* 0..1024 */
};

struct scene_model {
	enum model_name name;
	enum shading shading;
	enum optics_model optics;
	uint32_t paths; /* kinds of light that pictures show: bit set of 1 << (layer - LAYER_SUN_DIRECT), up to LAYER_AIR; never empty */
	/* Of MODEL_REFERENCE alone: */
	int samples;           /* light paths per pixel at most, 1..65536 */
	double time_budget_ms; /* the paths end here at the latest; 0: no such end, ..600000 */
	uint32_t seed;         /* of its random numbers */
	bool partial;          /* answer what there is when the request's own time is over, instead of nothing */
};

/* All of them. */
#define SCENE_PATHS_ALL ((1u << (LAYER_AIR - LAYER_SUN_DIRECT + 1)) - 1)

struct scene_output {
	int width;  /* 16..8192 */
	int height; /* 16..8192 */
	enum image_format format;
	bool exposure_auto;
	double exposure_ev; /* -20..20, used when not automatic */
	enum tone tone;
	uint32_t layers; /* bit set of 1 << enum layer, never empty */
	enum exr_compression exr_compression;
	enum exr_type exr_type;
	enum png_compression png_compression;
	int bits; /* of a PNG: 8 or 16 */
};

struct scene {
	struct scene_sun sun;
	struct scene_dsd dsd;
	struct scene_clouds clouds;
	struct scene_ground ground;
	struct scene_atmosphere atmosphere;
	struct scene_camera camera;
	struct scene_radiosity radiosity;
	struct scene_model model;
	struct scene_output output;
};

/* The scene that an empty request means. Padding is zeroed. Any thread. */
struct scene scene_default(void);

/* Is there a layer, of droplets that matter? */
bool scene_has_clouds(const struct scene *scene);

/* Liquid water content of a droplet size distribution in g/m3: 4/3 pi rho N0 <r^3>, rho = 1e6 g/m3. Any thread. */
double scene_dsd_liquid_water(const struct scene_dsd *dsd);

/* Shape that a camera's pictures have, as the smallest whole numbers, and their width when none is said. ratio is {0, 0} where any
 * shape goes. Any thread. */
struct scene_shape {
	int ratio[2]; /* width to height */
	int width, height;
};
struct scene_shape scene_camera_shape(const struct scene_camera *camera);

/* Axes of a camera: unit vectors to the right, up and forward in axes[0..2], each east, north, up. At the poles (elevation 90 and -90) up
 * is northwards, whatever the azimuth; a positive roll turns the picture clockwise, so the camera itself anticlockwise. A face of a cubemap
 * has its own, the whole of one those of its first face. Any thread. */
void scene_camera_axes(const struct scene_camera *camera, double axes[3][3]);

/* Largest reflectance that a ground shows in any band, albedo_scale included; a scene's is at most 1. Any thread. */
double scene_ground_largest_reflectance(const struct scene_ground *ground);

/* Names as they stand in JSON, indexed by the enumerations above; every list ends in NULL. */
extern const char *const scene_cloud_type_names[];
extern const char *const scene_ground_type_names[];
extern const char *const scene_projection_names[];
extern const char *const scene_face_names[]; /* FACE_ALL has none */
extern const char *const scene_model_names[];
extern const char *const scene_shading_names[];
extern const char *const scene_optics_names[];
extern const char *const scene_format_names[];
extern const char *const scene_tone_names[];
extern const char *const scene_png_compression_names[];
extern const char *const scene_exr_compression_names[];
extern const char *const scene_exr_type_names[];
extern const char *const scene_layer_names[];
extern const char *const scene_path_names[]; /* those of the layers that color is the sum of */

#endif
