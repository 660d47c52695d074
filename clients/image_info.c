#include "clients/image_info.h"

#include "clients/client.h"

#include <OpenEXR/openexr.h>
#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <string.h>

static const char scene_name[] = "stratus:scene";

/* The scene apart, everything else among the attributes. */
static void add_text(json_t *info, const char *name, const char *text, size_t length)
{
	json_t *scene = strcmp(name, scene_name) == 0 ? json_loadb(text, length, JSON_REJECT_DUPLICATES, NULL) : NULL;
	if (json_is_object(scene)) {
		json_object_set_new(info, "scene", scene);
		json_object_set_new(info, IMAGE_INFO_SCENE_TEXT, json_stringn(text, length));
		return;
	}
	json_decref(scene);
	json_object_set_new(json_object_get(info, "attributes"), name, json_stringn(text, length));
}

/* The libraries' messages quote bytes of the file. */
static void complain(const char *path, const char *message)
{
	char plain[256];
	size_t i = 0;
	for (; message[i] && i < sizeof plain - 1; i++)
		plain[i] = message[i] < 0x20 || message[i] > 0x7e ? '?' : message[i];
	plain[i] = '\0';
	client_error("%s: %s", path, plain);
}

/* --- PNG ---------------------------------------------------------------------------------------------------------------------- */

static void png_complain(png_structp png, png_const_charp message)
{
	complain(png_get_error_ptr(png), message);
	png_longjmp(png, 1);
}

static void png_stay_silent(png_structp png, png_const_charp message)
{
	(void)png, (void)message;
}

static void png_describe(png_structp png, png_infop header, json_t *info)
{
	png_textp texts;
	int count;
	json_object_set_new(info, "width", json_integer(png_get_image_width(png, header)));
	json_object_set_new(info, "height", json_integer(png_get_image_height(png, header)));
	json_object_set_new(info, "channels", json_integer(png_get_channels(png, header)));
	json_object_set_new(json_object_get(info, "attributes"), "bits", json_integer(png_get_bit_depth(png, header)));
	png_get_text(png, header, &texts, &count);
	for (int i = 0; i < count; i++)
		add_text(info, texts[i].key, texts[i].text,
			 texts[i].compression >= PNG_ITXT_COMPRESSION_NONE ? texts[i].itxt_length : texts[i].text_length);
}

static bool read_png(const char *path, FILE *file, json_t *info)
{
	png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, (png_voidp)path, png_complain, png_stay_silent);
	png_infop header = png ? png_create_info_struct(png) : NULL;
	volatile bool ok = false;
	if (header && !setjmp(png_jmpbuf(png))) {
		png_init_io(png, file);
		png_read_info(png, header);
		png_describe(png, header, info);
		ok = true;
	}
	png_destroy_read_struct(&png, &header, NULL);
	return ok;
}

/* --- EXR ---------------------------------------------------------------------------------------------------------------------- */

static void exr_complain(exr_const_context_t context, exr_result_t code, const char *message)
{
	const char *path = "";
	(void)code;
	exr_get_file_name(context, &path);
	complain(path, message);
}

static json_t *numbers(const float *values, size_t count)
{
	json_t *list = json_array();
	for (size_t i = 0; i < count; i++)
		json_array_append_new(list, json_real((double)values[i]));
	return list;
}

static json_t *channel_names(const exr_attr_chlist_t *channels)
{
	json_t *list = json_array();
	for (int i = 0; i < channels->num_channels; i++)
		json_array_append_new(list, json_stringn(channels->entries[i].name.str, (size_t)channels->entries[i].name.length));
	return list;
}

static void add_attribute(json_t *info, const exr_attribute_t *attribute)
{
	json_t *attributes = json_object_get(info, "attributes");
	switch (attribute->type) {
	case EXR_ATTR_STRING:
		add_text(info, attribute->name, attribute->string->str, (size_t)attribute->string->length);
		break;
	case EXR_ATTR_FLOAT:
		json_object_set_new(attributes, attribute->name, json_real((double)attribute->f));
		break;
	case EXR_ATTR_INT:
		json_object_set_new(attributes, attribute->name, json_integer(attribute->i));
		break;
	case EXR_ATTR_CHROMATICITIES:
		json_object_set_new(attributes, attribute->name, numbers(&attribute->chromaticities->red_x, 8));
		break;
	case EXR_ATTR_V2F:
		json_object_set_new(attributes, attribute->name, numbers(&attribute->v2f->x, 2));
		break;
	case EXR_ATTR_M44F:
		json_object_set_new(attributes, attribute->name, numbers(attribute->m44f->m, 16));
		break;
	case EXR_ATTR_ENVMAP:
		json_object_set_new(attributes, attribute->name, json_string(attribute->uc == 0 ? "latlong" : "cube"));
		break;
	case EXR_ATTR_CHLIST:
		json_object_set_new(info, "channels", channel_names(attribute->chlist));
		break;
	default: /* of no use to a reader of text */
		break;
	}
}

static bool read_exr(const char *path, json_t *info)
{
	static const char *const compressions[] = {"none", "rle", "zips", "zip", "piz", "pxr24", "b44", "b44a", "dwaa", "dwab"};
	exr_context_initializer_t settings = EXR_DEFAULT_CONTEXT_INITIALIZER;
	exr_context_t context = NULL;
	exr_attr_box2i_t window;
	exr_compression_t compression;
	int32_t count = 0;
	settings.error_handler_fn = exr_complain;
	bool ok = exr_start_read(&context, path, &settings) == EXR_ERR_SUCCESS &&
		  exr_get_data_window(context, 0, &window) == EXR_ERR_SUCCESS &&
		  exr_get_compression(context, 0, &compression) == EXR_ERR_SUCCESS &&
		  exr_get_attribute_count(context, 0, &count) == EXR_ERR_SUCCESS;
	if (ok) {
		json_object_set_new(info, "width", json_integer((json_int_t)window.max.x - window.min.x + 1));
		json_object_set_new(info, "height", json_integer((json_int_t)window.max.y - window.min.y + 1));
		if ((size_t)compression < sizeof compressions / sizeof *compressions)
			json_object_set_new(json_object_get(info, "attributes"), "compression", json_string(compressions[compression]));
	}
	for (int32_t i = 0; ok && i < count; i++) {
		const exr_attribute_t *attribute;
		ok = exr_get_attribute_by_index(context, 0, EXR_ATTR_LIST_FILE_ORDER, i, &attribute) == EXR_ERR_SUCCESS;
		if (ok)
			add_attribute(info, attribute);
	}
	exr_finish(&context);
	return ok;
}

/* --- either ------------------------------------------------------------------------------------------------------------------- */

json_t *image_info_read(const char *path)
{
	static const unsigned char exr_magic[4] = {0x76, 0x2f, 0x31, 0x01};
	unsigned char magic[8] = {0};
	FILE *file = fopen(path, "rb");
	const size_t got = file ? fread(magic, 1, sizeof magic, file) : 0;
	if (!file || ferror(file)) {
		client_error("%s: %s", path, strerror(errno));
		if (file)
			fclose(file);
		return NULL;
	}
	const bool png = got == sizeof magic && png_sig_cmp(magic, 0, sizeof magic) == 0;
	const bool exr = got == sizeof magic && memcmp(magic, exr_magic, sizeof exr_magic) == 0;
	json_t *info = json_pack("{s:s, s:{}}", "format", png ? "png" : "exr", "attributes");
	bool ok = false;
	rewind(file);
	if (!png && !exr)
		client_error("%s: is neither a PNG nor an EXR", path);
	else
		ok = info && (png ? read_png(path, file, info) : read_exr(path, info));
	fclose(file);
	if (ok)
		return info;
	json_decref(info);
	return NULL;
}
