/* The renderer: scenes in, pixels out. Knows no HTTP, no JSON and no image files.
 *
 * One thread owns a renderer and its OpenGL context: renderer_create, renderer_render and renderer_destroy are called by that
 * thread alone. renderer_info may be read by any thread after creation.
 */
#ifndef STRATUS_RENDERER_RENDERER_H
#define STRATUS_RENDERER_RENDERER_H

#include "renderer/droplet_store.h"
#include "renderer/optics/optics.h"
#include "renderer/scene.h"

#include <stddef.h>

/* Changes whenever the same scene may give other pixels. Part of every ETag. */
#define RENDERER_VERSION "0.4.0"

enum pass_kind { PASS_AUTO, PASS_FRAGMENT, PASS_COMPUTE };

struct renderer_params {
	int device_index;               /* EGL device, from 0; negative: the first hardware device, else software */
	bool require_gpu;               /* refuse software rendering */
	enum pass_kind pass_kind;       /* how full-screen passes run; PASS_AUTO measures at start */
	const char *shader_dir;         /* read shaders from here instead of the embedded ones; NULL: embedded */
	struct droplet_store *droplets; /* their tables; must outlive the renderer */
	size_t cache_bytes;             /* bound of what the stages remember on the GPU; 0: 256 MiB */
};

struct renderer_info {
	const char *vendor, *renderer, *version; /* strings of OpenGL */
	const char *platform;                    /* how EGL came up: "device 0" or "surfaceless" */
	bool software;
	enum pass_kind pass_kind; /* what is in use, never PASS_AUTO */
	int max_texture_size;
};

enum stage { STAGE_OPTICS, STAGE_SKY, STAGE_FIELD, STAGE_RADIOSITY, STAGE_VIEW, STAGE_READBACK, STAGE_COUNT };

/* "optics", "sky", "field", "radiosity", "view", "readback" */
extern const char *const stage_names[STAGE_COUNT];

struct stage_timing {
	double milliseconds; /* processor time for optics and read-back, GPU timer queries for the rest */
	bool reused;         /* taken from memory */
};

enum pixel_type { PIXEL_U8, PIXEL_U16, PIXEL_F32 };

enum { RADIOSITY_PASSES_LISTED = 32 };

/* One rendered picture: `layer_count` planes of height x width x channels, rows from the top, channels interleaved. */
struct frame {
	int width, height;
	enum pixel_type type; /* U8/U16: exposed, toned, sRGB encoded. F32: scene-linear Rec.709, (1,1,1) = 1000 cd/m2 */
	int channels;         /* 3: RGB; single-valued layers (optical_thickness, distance) repeat their value */
	int layer_count;
	enum layer layer[LAYER_COUNT];
	void *pixels; /* malloc'd; NULL while they are elsewhere (renderer_start) */
	size_t bytes;
	struct transfer *transfer; /* NULL: pixels are here */

	int samples;  /* light paths behind every pixel, at least; 0: another model than the reference */
	bool partial; /* fewer than were asked for, because the request was cancelled */

	struct stage_timing timing[STAGE_COUNT];
	int radiosity_passes;      /* 0 when not run */
	double radiosity_residual; /* light on its way when the exchange stopped, over what the ground receives; 0 when not run */
	double radiosity_residuals[RADIOSITY_PASSES_LISTED]; /* the same after each of the first passes */
	double exposure_ev;                                  /* what multiplied the picture: 2^exposure_ev, also when automatic */
	/* On a horizontal plane at the camera, integrated over the hemisphere above it; EXR only, 0 otherwise. */
	double global_illuminance_lux; /* direct + diffuse */
	double direct_illuminance_lux; /* by the beam, through the cloud before it */
	double diffuse_illuminance_lux;
};

struct renderer;
struct transfer; /* pixels between the renderer and a frame */

/* So many pictures may be on their way at a time; others are waited for. */
enum { RENDERER_TRANSFERS_MAX = 3 };

/* Brings up EGL and OpenGL and compiles every shader. NULL (the log names what was tried) on failure. */
struct renderer *renderer_create(const struct renderer_params *params);
/* Waits for frames whose pixels are still the renderer's. Takes NULL. */
void renderer_destroy(struct renderer *renderer);

const struct renderer_info *renderer_info(const struct renderer *renderer);

/* Bytes of what a stage remembers on the GPU. Any thread, as long as the renderer lives. */
size_t renderer_cache_bytes(const struct renderer *renderer, enum stage stage);

/* Asked between passes by renderer_render: true stops the work. */
typedef bool renderer_cancelled(void *context);

enum render_result {
	RENDER_OK,
	RENDER_UNFINISHED,
	RENDER_CANCELLED,
	RENDER_OUT_OF_MEMORY,
	RENDER_NO_PROGRAM, /* a shader that this scene takes does not compile, which the log names; others may do */
	RENDER_FAILED
};

/* Renders a valid scene; a map that it names must be there. cancelled may be NULL. On RENDER_OK the caller owns frame->pixels
 * (frame_finish); else the frame is zeroed and one log line says why. A scene of MODEL_REFERENCE with model.partial that is cancelled after
 * its first samples is RENDER_OK, frame->partial. */
enum render_result renderer_render(struct renderer *renderer, const struct scene *scene, renderer_cancelled *cancelled, void *context,
				   struct frame *frame);

/* A picture of MODEL_REFERENCE on its way. */
struct render_pending;

/* As renderer_render, for who has other pictures to render as well: when `paused` says true, which is asked every 50 ms or so of a
 * reference, the result is RENDER_UNFINISHED and *pending is set; the same call goes on with it, after whatever others. With any other
 * result *pending is NULL, as it is at first. */
enum render_result renderer_render_some(struct renderer *renderer, const struct scene *scene, renderer_cancelled *cancelled,
					renderer_cancelled *paused, void *context, struct render_pending **pending, struct frame *frame);

/* Forgets a picture on its way, which begins anew with the next call. Takes one that is NULL. */
void renderer_drop_pending(struct render_pending **pending);

/* Why a context is to be made anew. */
enum renderer_loss { RENDERER_NOT_LOST, RENDERER_LOST_GUILTY, RENDERER_LOST_INNOCENT, RENDERER_LOST_UNKNOWN };

/* Looks whether the OpenGL context of the calling thread's renderer was lost: then every call fails, and another renderer is wanted, which
 * may be created after renderer_destroy. What was on its way is lost with it. By whose fault: as far as the driver knows. */
enum renderer_loss renderer_look(void);

/* Memory of the device that nobody uses, bytes; negative where the driver does not say. Of the calling thread's renderer. */
double renderer_free_memory(void);

/* As renderer_render_some, without waiting for the GPU at the end: on RENDER_OK the picture may still be on its way, frame->transfer, while
 * the next one is begun. The frame's timing, but for the optics, is that of its arrival. */
enum render_result renderer_start(struct renderer *renderer, const struct scene *scene, renderer_cancelled *cancelled,
				  renderer_cancelled *paused, void *context, struct render_pending **pending, struct frame *frame);

/* Has a picture arrived? RENDER_UNFINISHED: not within so many milliseconds. With RENDER_FAILED the frame is zeroed. May be called from
 * `cancelled` of another picture. */
enum render_result renderer_arrive(struct renderer *renderer, struct frame *frame, double milliseconds);

/* The pixels of a picture that has arrived, into frame->pixels; nothing where they are already. Any thread; to be done soon, since few
 * pictures can be between. false when out of memory. */
bool frame_take_pixels(struct frame *frame);

/* Directions to look at the sky in: each zenith angle with each azimuth. */
struct sky_directions {
	int view_count, azimuth_count; /* from 1 */
	const double *view_zenith_deg; /* 0..90 */
	const double *azimuth_deg;     /* -360..720, of the viewing direction, clockwise from north */
};

/* What a clear sky sends to the ground, per band, over the solar irradiance outside the atmosphere on a plane normal to the beam. */
struct sky_light {
	double *radiance;               /* [band][view][azimuth], 1/sr; malloc'd, the sun's disc is not in it */
	double direct_transmittance[3]; /* of the beam, on a plane normal to it; 0 when the sun has set */
	double diffuse_irradiance[3];   /* horizontal */
	struct stage_timing timing;     /* of the sky stage; never reused: directions are always computed */
};

/* The sky of a valid scene's sun, atmosphere and ground, without clouds. As renderer_render; on RENDER_OK the caller frees radiance. */
enum render_result renderer_sky_light(struct renderer *renderer, const struct scene *scene, const struct sky_directions *directions,
				      renderer_cancelled *cancelled, void *context, struct sky_light *light);

/* Frees the pixels, or gives them back, and leaves the rest. Any thread. */
void frame_drop_pixels(struct frame *frame);

/* Likewise, and zeroes the frame. Takes a zeroed one. */
void frame_finish(struct frame *frame);

#endif
