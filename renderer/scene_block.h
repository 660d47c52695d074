/* The uniform block that every pass sees, as laid out by std140: four floats a member, nothing else. The GLSL side is
 * shaders/lib/scene_block.glsl, with the same names in the same order. Colours are per band: 650, 550, 450 nm.
 */
#ifndef STRATUS_RENDERER_SCENE_BLOCK_H
#define STRATUS_RENDERER_SCENE_BLOCK_H

enum { SCENE_BLOCK_BINDING = 0, SEA_WAVES = 128 };

struct scene_block {
	float sun_direction[4];    /* unit vector to the sun; angular radius in radians */
	float sun_at_camera[4];    /* irradiance by the sun at the camera on a plane normal to the beam, W/m2/nm; - */
	float solar_irradiance[4]; /* outside the atmosphere on a plane normal to the beam, W/m2/nm; - */
	float rayleigh[4];         /* scattering coefficient at the ground, 1/m; scale height up to 10 km, m */
	float aerosol[4];          /* extinction coefficient at the ground, 1/m; scale height, m */
	float aerosol_shape[4];    /* single scattering albedo; asymmetry; -; - */
	float ozone[4];            /* absorption coefficient at its peak, 1/m; height of the peak, m */
	float ground_albedo[4];    /* of lambert ground, else the scale alone; type of ground (enum ground_type) */
	float ground_patch[4];     /* side of the ground's picture in texels; of what is smaller: contrast, deviation of slopes, length over
				      width; of a sea second its scale */
	float ground_mean_albedo[4]; /* over the tile; side of the ground's picture, m, of which a whole number make the tile */
	float ground_region[4]; /* place of the camera's tile, in pictures: east, north; 1 where the ground that is seen is put together out
				   of regions; - */
	float camera_position[4]; /* x, y modulo the tile, z: metres above ground; angle between pixel centres, rad */
	float camera_right[4];    /* unit; tangent of half the horizontal field of view */
	float camera_up[4];       /* unit; tangent of half the vertical field of view */
	float camera_forward[4];  /* unit; first row of the view in the picture */
	float image_size[4];      /* width and height of the view; 1/width, 1/height */
	float sun_disc_box[4];    /* box of weights: column, row, width, height; or of a large disc: 1/(share above the horizon) */
	float cloud_layer[4];     /* base, m; thickness (maximum of H), m; tile, m; 1 when there are clouds */
	float cloud_field[4];     /* share of the range where edges are thin; shift of detail, m a density; its tiles; billows, m */
	float cloud_drift[4];     /* drift so far, m, modulo the tile: east, north; -; - */
	float cloud_warp[4];      /* phases of its waves at the camera, turns; 1 where there is one (shaders/lib/field_warp.glsl) */
	float cloud_puffs[4];     /* on tops seen from above: how far they bulge from crease to top, m; their tile, m; texels a side of the
				   * height field; -
				   */
	float cloud_puffs_drift[4]; /* where in their volume the tile's corner is: east, north, up, volumes; - */
	float cloud_detail[4];      /* tile of the detail, m; its drift, m: east, north; weight */
	float cloud_threshold[4]; /* field value where H begins; 1/(range above it); roundness of H, 0: a map of H; resolution of the field
				   */
	float extinction[4];      /* kappa, 1/m; - */
	float extinction_modified[4]; /* kappa_S, 1/m; - */
	float extinction_scaled[4];   /* of what does not go straight on, 1/m: (1 - f) kappa when solved, else kappa_S; q of thick layers */
	float slab_slice_range[4];    /* slices: coordinate of the first; slices per unit of it; slices a side; planes of all */
	float slab_light[4];          /* 1 where the sun lights: top; base; length over which thickness evens out, m; (1-g) kappa, 550 nm */
	float sky_irradiance_cloud[4];  /* clear sky on a horizontal plane at the top of the layer, W/m2/nm */
	float sky_irradiance_ground[4]; /* the same at the ground, without clouds */
	float air_below[4];             /* share of a clear sky's light that the clouds leave to the air beneath them, 0..1 */
	float air_around[4];            /* radiance that this air scatters beside, of light which comes from cloud base and ground */
	float band_red[4];              /* linear Rec.709 of unit radiance at 650 nm, 1 = 1000 cd/m2 (stages/colour.h) */
	float band_green[4];            /* 550 nm */
	float band_blue[4];             /* 450 nm */
	float develop[4];   /* exposure: automatic (1) or fixed (0); its value, EV; tone (enum tone); largest code of the output */
	float sea_state[4]; /* covariance of the sea's slopes: east-east, east-north, north-north; share of foam */
	float sea_waves[SEA_WAVES]
		       [4]; /* longest first: wave number, 1/m, east, north; phase at the camera's foot, turns; slope over it, m */
};

#endif
