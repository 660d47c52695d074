#include "server/slab_answer.h"

#include <jansson.h>

static json_t *numbers_to_json(const double *numbers, int count)
{
	json_t *array = json_array();
	for (int i = 0; i < count; i++)
		json_array_append_new(array, json_real(numbers[i]));
	return array;
}

static json_t *bands_to_json(const double numbers[BAND_COUNT])
{
	return numbers_to_json(numbers, BAND_COUNT);
}

/* One order of all bands: `of` is r or t of the first band's. */
static json_t *order_to_json(const struct slab_orders orders[BAND_COUNT], char of, int order)
{
	double numbers[BAND_COUNT];
	for (int band = 0; band < BAND_COUNT; band++)
		numbers[band] = of == 'r' ? orders[band].r[order] : orders[band].t[order];
	return bands_to_json(numbers);
}

static json_t *orders_to_json(const struct slab_orders orders[BAND_COUNT])
{
	json_t *object = json_object();
	for (int order = 1; order < 4; order++)
		json_object_set_new(object, (const char[]){'r', (char)('0' + order), '\0'}, order_to_json(orders, 'r', order));
	for (int order = 0; order < 4; order++)
		json_object_set_new(object, (const char[]){'t', (char)('0' + order), '\0'}, order_to_json(orders, 't', order));
	return object;
}

static json_t *radiance_to_json(const struct slab_query *query, const double *radiance, int side)
{
	json_t *bands = json_array();
	for (int band = 0; band < BAND_COUNT; band++) {
		json_t *views = json_array();
		for (int view = 0; view < query->view_count; view++)
			json_array_append_new(
				views, numbers_to_json(radiance + slab_radiance_index(query, side, band, view, 0), query->azimuth_count));
		json_array_append_new(bands, views);
	}
	return bands;
}

static json_t *angles_to_json(const struct slab_query *query, int side)
{
	json_t *views = json_array();
	for (int view = 0; view < query->view_count; view++) {
		json_t *azimuths = json_array();
		for (int i = 0; i < query->azimuth_count; i++)
			json_array_append_new(azimuths, json_real(slab_scattering_angle_deg(query, side, view, i)));
		json_array_append_new(views, azimuths);
	}
	return views;
}

/* Fluxes, orders and radiance under the same names for values and standard errors. */
static json_t *values_to_json(const struct slab_query *query, const struct slab_values *values)
{
	return json_pack("{s:o, s:o, s:o, s:o, s:{s:o, s:o}}", "reflectance", bands_to_json(values->reflectance), "transmittance_direct",
			 bands_to_json(values->transmittance_direct), "transmittance_diffuse", bands_to_json(values->transmittance_diffuse),
			 "orders", orders_to_json(values->orders), "radiance", "reflected",
			 radiance_to_json(query, values->radiance, SLAB_REFLECTED), "transmitted",
			 radiance_to_json(query, values->radiance, SLAB_TRANSMITTED));
}

/* What names the orders and the directions of radiance. */
static void add_coordinates(const struct slab_query *query, json_t *values)
{
	json_t *radiance = json_object_get(values, "radiance");
	json_t *angles = json_pack("{s:o, s:o}", "reflected", angles_to_json(query, SLAB_REFLECTED), "transmitted",
				   angles_to_json(query, SLAB_TRANSMITTED));
	json_object_set_new(json_object_get(values, "orders"), "phase_function", json_string(slab_phase_names[query->phase]));
	json_object_set_new(radiance, "view_zenith_deg", numbers_to_json(query->view_zenith_deg, query->view_count));
	json_object_set_new(radiance, "relative_azimuth_deg", numbers_to_json(query->relative_azimuth_deg, query->azimuth_count));
	json_object_set_new(radiance, "scattering_angle_deg", angles);
}

static json_t *question_to_json(const struct slab_query *query, const struct slab_numbers *numbers)
{
	json_t *root = json_object();
	json_object_set_new(root, "wavelength_nm", bands_to_json(band_wavelength_nm));
	json_object_set_new(root, "shading", json_string(slab_method_names[query->method]));
	json_object_set_new(root, "sun_zenith_deg", json_real(query->sun_zenith_deg));
	json_object_set_new(root, "optical_thickness", bands_to_json(numbers->optical_thickness));
	if (query->thickness_m > 0)
		json_object_set_new(root, "thickness_m", json_real(query->thickness_m));
	if (query->method == SLAB_BY_PHOTONS) {
		json_object_set_new(root, "photons", json_integer((json_int_t)query->photons));
		json_object_set_new(root, "seed", json_integer((json_int_t)query->seed));
	}
	return root;
}

char *slab_answer_format(const struct slab_query *query, const struct slab_numbers *numbers)
{
	json_t *root = question_to_json(query, numbers), *values = values_to_json(query, &numbers->value);
	add_coordinates(query, values);
	json_object_update_new(root, values);
	if (query->method == SLAB_BY_PHOTONS)
		json_object_set_new(root, "standard_error", values_to_json(query, &numbers->error));
	char *text = json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(9));
	json_decref(root);
	return text;
}
