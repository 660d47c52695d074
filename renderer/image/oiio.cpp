/* The module that writes and reads image files through OpenImageIO; the only C++ of the tree (image.h tells why it is a module).
 *
 * Inside, failures are exceptions; encode() and decode() at the end are the doors to C and turn them into messages. Nothing varying enters
 * a file (no date, no host, no request id), so that the same frame and scene give the same bytes.
 */
extern "C" {
#include "renderer/image/image.h"
}

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/half.h>
#include <OpenImageIO/imageio.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <vector>

extern "C" const struct image_api *stratus_image_api(void);

namespace
{

using OIIO::ImageInput;
using OIIO::ImageOutput;
using OIIO::ImageSpec;
using OIIO::TypeDesc;

using bytes = std::vector<unsigned char>;

constexpr float half_max = 65504.0f;

/* PNG_FILTER_SUB of libpng: on smooth, dithered pictures both the quickest filter and the one that leaves the smallest file. */
constexpr int png_filter_sub = 0x10;

std::unique_ptr<ImageOutput> open_output(const char *format, const ImageSpec &spec, OIIO::Filesystem::IOProxy *proxy)
{
	auto out = ImageOutput::create(format);
	if (!out)
		throw std::runtime_error(OIIO::geterror());
	out->threads(1);
	out->set_ioproxy(proxy);
	if (!out->open(std::string("memory.") + format, spec))
		throw std::runtime_error(out->geterror());
	return out;
}

void close_output(ImageOutput &out)
{
	if (!out.close())
		throw std::runtime_error(out.geterror());
}

void require(bool condition, const char *message)
{
	if (!condition)
		throw std::runtime_error(message);
}

/* Rows that are written at once: a multiple of every EXR compressor's block, at most 32 lines. */
constexpr int rows_at_once = 64;

constexpr const char *unwanted = "nobody waits for it any more";

bool is_wanted(const struct image_watch *watch)
{
	return !watch || !watch->is_over(watch->context);
}

/* --- PNG ------------------------------------------------------------------------------------------------------------------ */

void append_be32(bytes &to, uint32_t value)
{
	for (int shift = 24; shift >= 0; shift -= 8)
		to.push_back(static_cast<unsigned char>(value >> shift));
}

/* An uncompressed iTXt chunk. OpenImageIO writes texts as tEXt, which is Latin-1 by definition; JSON is UTF-8. */
bytes png_text_chunk(const std::string &keyword, const char *text)
{
	bytes chunk;
	const std::string body = "iTXt" + keyword + std::string(5, '\0') + text; /* no compression, language or translated keyword */
	append_be32(chunk, static_cast<uint32_t>(body.size() - 4));
	chunk.insert(chunk.end(), body.begin(), body.end());
	append_be32(chunk, static_cast<uint32_t>(crc32(0, reinterpret_cast<const Bytef *>(body.data()), static_cast<uInt>(body.size()))));
	return chunk;
}

/* Texts go right behind the header, where a reader of a truncated file finds them too. */
void png_insert_text(bytes &png, const std::string &keyword, const char *text)
{
	constexpr size_t header_end = 8 + 25; /* signature and IHDR */
	require(png.size() > header_end, "the PNG encoder wrote no header");
	const bytes chunk = png_text_chunk(keyword, text);
	png.insert(png.begin() + header_end, chunk.begin(), chunk.end());
}

struct png_effort {
	const char *strategy; /* of zlib, by OpenImageIO's names */
	int level;
};

/* Dithered differences hold few repeats, so that searching for them costs more than it saves: run lengths and Huffman codes beat
 * zlib's quick levels in time and size. */
constexpr png_effort png_fast = {"rle", 1};

/* Which of these is smaller depends on how much of the picture is flat; level 9 would save 2 % more in eight times the time. */
constexpr png_effort png_small[] = {{"huffman", 1}, {"filtered", 6}};

bytes encode_png_with(const png_effort &effort, const struct frame &frame, const struct image_metadata &metadata,
		      const struct image_watch *watch)
{
	const TypeDesc type = frame.type == PIXEL_U8 ? TypeDesc::UINT8 : TypeDesc::UINT16;
	ImageSpec spec(frame.width, frame.height, 3, type);
	spec.attribute("oiio:ColorSpace", "sRGB");
	spec.attribute("Software", metadata.software);
	spec.attribute("png:filter", png_filter_sub);
	spec.attribute("compression", effort.strategy);
	spec.attribute("png:compressionLevel", effort.level);

	OIIO::Filesystem::IOVecOutput proxy;
	proxy.buffer().reserve(frame.bytes / 2);
	auto out = open_output("png", spec, &proxy);
	const size_t row_bytes = 3 * static_cast<size_t>(frame.width) * (frame.type == PIXEL_U8 ? 1 : 2);
	const bytes blank(rows_at_once * row_bytes);
	bool wanted = true;
	for (int y = 0; y < frame.height; y += rows_at_once) {
		/* libpng complains on standard error of pictures without an end: they get a black one, which takes no time. */
		wanted = wanted && is_wanted(watch);
		const unsigned char *rows = static_cast<const unsigned char *>(frame.pixels) + static_cast<size_t>(y) * row_bytes;
		if (!out->write_scanlines(y, std::min(y + rows_at_once, frame.height), 0, type, wanted ? rows : blank.data()))
			throw std::runtime_error(out->geterror());
	}
	close_output(*out);
	require(wanted, unwanted);
	return std::move(proxy.buffer());
}

bytes encode_png(const struct frame &frame, const struct scene &scene, const struct image_metadata &metadata,
		 const struct image_watch *watch)
{
	const int bits = frame.type == PIXEL_U8 ? 8 : 16;
	require(frame.type != PIXEL_F32 && bits == scene.output.bits, "a PNG needs a developed frame of the depth the scene asks for");
	require(frame.layer_count == 1 && frame.layer[0] == LAYER_COLOR, "a PNG holds the layer color alone");

	bytes png;
	if (scene.output.png_compression == PNG_FAST) {
		png = encode_png_with(png_fast, frame, metadata, watch);
	} else {
		for (const png_effort &effort : png_small) {
			bytes other = encode_png_with(effort, frame, metadata, watch);
			if (png.empty() || other.size() < png.size())
				png = std::move(other);
		}
	}
	char exposure[32];
	std::snprintf(exposure, sizeof exposure, "%.4f", frame.exposure_ev);
	png_insert_text(png, "stratus:exposure_ev", exposure);
	if (metadata.comparison)
		png_insert_text(png, "stratus:comparison", metadata.comparison);
	else
		png_insert_text(png, "stratus:scene", metadata.scene_json);
	if (frame.samples > 0) {
		png_insert_text(png, "stratus:partial", frame.partial ? "true" : "false");
		png_insert_text(png, "stratus:samples", std::to_string(frame.samples).c_str());
	}
	return png;
}

/* --- EXR ------------------------------------------------------------------------------------------------------------------ */

struct channel {
	std::string name;
	const float *first; /* of the plane's pixels */
	int stride;         /* to the next one */
	bool is_half;
};

struct picture_size {
	int width, height;
};

/* Names that compositors group: R, G, B for color, NAME.R .G .B for the others; depth is Z and a plain quantity Y. */
std::vector<std::string> channel_names(enum layer layer)
{
	const std::string prefix = layer == LAYER_COLOR ? "" : std::string(scene_layer_names[layer]) + ".";
	if (layer == LAYER_DISTANCE)
		return {prefix + "Z"};
	if (layer == LAYER_OPTICAL_THICKNESS)
		return {prefix + "Y"};
	return {prefix + "R", prefix + "G", prefix + "B"};
}

/* The largest magnitude of a channel; refuses what is not finite, since it would spread through any later filter. */
float channel_peak(picture_size size, const struct channel &channel)
{
	const size_t count = static_cast<size_t>(size.width) * size.height;
	float peak = 0, poison = 0;
	for (size_t i = 0; i < count; i++) {
		const float value = channel.first[i * channel.stride];
		peak = std::max(peak, std::fabs(value));
		poison += value * 0.0f; /* NaN from the first inf or NaN on */
	}
	if (!(poison == 0.0f))
		throw std::runtime_error("channel " + channel.name + " holds a value that is not finite");
	return peak;
}

/* Does half keep too little of a channel? It has its 11 bits from 2^-14 to 65504. Below, it has the fewer the smaller a value is, which
 * matters within twelve stops of the channel's peak: what is darker is invisible beside that. One value in a hundred may be lost so. */
bool is_beyond_half(picture_size size, const struct channel &channel, float peak)
{
	constexpr float half_normal = 1.0f / 16384, shadow = 1.0f / 4096;
	if (peak > half_max)
		return true;
	const float least = shadow * peak;
	if (least >= half_normal)
		return false;
	const size_t count = static_cast<size_t>(size.width) * size.height;
	size_t seen = 0, coarse = 0;
	for (size_t i = 0; i < count; i++) {
		const float value = std::fabs(channel.first[i * channel.stride]);
		const bool matters = value > 0 && value >= least;
		seen += matters;
		coarse += matters && value < half_normal;
	}
	return coarse * 100 > seen;
}

std::vector<channel> list_channels(const struct frame &frame)
{
	std::vector<channel> channels;
	const size_t plane = static_cast<size_t>(frame.width) * frame.height * frame.channels;
	for (int i = 0; i < frame.layer_count; i++) {
		int component = 0;
		for (const std::string &name : channel_names(frame.layer[i]))
			channels.push_back(
				{name, static_cast<const float *>(frame.pixels) + i * plane + component++, frame.channels, false});
	}
	return channels;
}

std::vector<channel> list_channels(const struct image_planes &planes)
{
	std::vector<channel> channels;
	for (size_t i = 0; i < planes.count; i++)
		channels.push_back({planes.plane[i].name, planes.plane[i].values, planes.plane[i].stride, false});
	return channels;
}

/* Half where the type allows. Returns whether that clamps any value. */
bool choose_types(picture_size size, enum exr_type type, std::vector<channel> &channels)
{
	bool clamped = false;
	for (channel &channel : channels) {
		const float peak = channel_peak(size, channel);
		channel.is_half = type == EXR_HALF || (type == EXR_AUTO && !is_beyond_half(size, channel, peak));
		clamped = clamped || (type == EXR_HALF && peak > half_max);
	}
	return clamped;
}

/* From the file's world (+X east, +Y up, +Z south) to EXR's camera space (left-handed, +x right, +y up, +z view), as Imath has
 * it: row vectors, point * matrix. */
void camera_matrix(const struct scene_camera &camera, float matrix[16])
{
	double axes[3][3];
	scene_camera_axes(&camera, axes);
	for (int axis = 0; axis < 3; axis++) {
		const double *a = axes[axis];
		const double *p = camera.position_m;
		matrix[0 * 4 + axis] = static_cast<float>(a[0]);
		matrix[1 * 4 + axis] = static_cast<float>(a[2]);
		matrix[2 * 4 + axis] = static_cast<float>(-a[1]);
		matrix[3 * 4 + axis] = static_cast<float>(-(a[0] * p[0] + a[1] * p[1] + a[2] * p[2]));
		matrix[axis * 4 + 3] = 0;
	}
	matrix[15] = 1;
}

/* From camera space on to EXR's normalized device coordinates, (0, 0) at the upper left corner of the picture and (1, 1) at the lower
 * right one, as homogeneous coordinates over the depth. width, height: of the picture at distance 1. */
void device_matrix(const float camera[16], double width, double height, float matrix[16])
{
	for (int row = 0; row < 4; row++) {
		const double x = camera[row * 4], y = camera[row * 4 + 1], depth = camera[row * 4 + 2];
		matrix[row * 4] = static_cast<float>(x / width + 0.5 * depth);
		matrix[row * 4 + 1] = static_cast<float>(0.5 * depth - y / height);
		matrix[row * 4 + 2] = matrix[row * 4 + 3] = static_cast<float>(depth);
	}
}

/* height: of the picture at distance 1 */
void describe_perspective(ImageSpec &spec, const struct scene_camera &camera, double height)
{
	float to_camera[16], to_device[16];
	const double width = height * spec.width / spec.height;
	camera_matrix(camera, to_camera);
	device_matrix(to_camera, width, height, to_device);
	spec.attribute("worldtocamera", OIIO::TypeMatrix44, to_camera);
	spec.attribute("worldToNDC", OIIO::TypeMatrix44, to_device);
	spec.attribute("screenWindowWidth", static_cast<float>(width));
}

void describe_projection(ImageSpec &spec, const struct scene &scene)
{
	switch (scene.camera.projection) {
	case PROJECTION_PERSPECTIVE:
		describe_perspective(spec, scene.camera, 2 * std::tan(scene.camera.vertical_fov_deg * M_PI / 360));
		break;
	case PROJECTION_EQUIRECTANGULAR:
		spec.attribute("textureformat", "LatLong Environment");
		spec.attribute("openexr:levelmode", 0); /* one level: scan lines, no pyramid */
		break;
	case PROJECTION_CUBEMAP:
		if (scene.camera.face != FACE_ALL) {
			describe_perspective(spec, scene.camera, 2);
			break;
		}
		spec.attribute("textureformat", "CubeFace Environment");
		spec.attribute("openexr:levelmode", 0);
		break;
	case PROJECTION_FISHEYE: /* EXR has no word for it; the scene says it */
	case PROJECTION_COUNT:
		break;
	}
}

/* When and where the picture was "taken": the scene's own time and place, never those of the machine. */
void describe_time_and_place(ImageSpec &spec, const struct scene_sun &sun)
{
	/* OpenImageIO adds the date unless there is one; one that is no text keeps it out and is itself not written. */
	spec.attribute("DateTime", 0);
	if (!sun.by_time)
		return;
	const std::time_t seconds = static_cast<std::time_t>(std::floor((sun.julian_day - 2440587.5) * 86400 + 5e-4));
	std::tm date;
	char text[sizeof "2003:10:17 19:30:30"];
	require(gmtime_r(&seconds, &date) && std::strftime(text, sizeof text, "%Y:%m:%d %H:%M:%S", &date) > 0, "the time has no date");
	spec.attribute("DateTime", text);
	spec.attribute("utcOffset", 0.0f);
	spec.attribute("latitude", static_cast<float>(sun.latitude_deg));
	spec.attribute("longitude", static_cast<float>(sun.longitude_deg));
}

ImageSpec exr_spec(picture_size size, const struct scene &scene, const struct image_metadata &metadata,
		   const std::vector<channel> &channels, bool clamped)
{
	ImageSpec spec(size.width, size.height, static_cast<int>(channels.size()), TypeDesc::FLOAT);
	spec.channelnames.clear();
	for (const channel &channel : channels) {
		spec.channelnames.push_back(channel.name);
		spec.channelformats.push_back(channel.is_half ? TypeDesc::HALF : TypeDesc::FLOAT);
	}
	const float rec709_d65[8] = {0.64f, 0.33f, 0.30f, 0.60f, 0.15f, 0.06f, 0.3127f, 0.3290f};
	spec.attribute("chromaticities", TypeDesc(TypeDesc::FLOAT, 8), rec709_d65);
	spec.attribute("whiteLuminance", 1000.0f); /* cd/m2 of (1,1,1) */
	spec.attribute("adoptedNeutral", TypeDesc(TypeDesc::FLOAT, TypeDesc::VEC2), rec709_d65 + 6);
	spec.attribute("compression", scene_exr_compression_names[scene.output.exr_compression]);
	spec.attribute("software", metadata.software);
	describe_time_and_place(spec, scene.sun);
	spec.attribute("altitude", static_cast<float>(scene.camera.position_m[2]));
	describe_projection(spec, scene);
	spec.attribute("stratus:scene", metadata.scene_json);
	if (metadata.comparison)
		spec.attribute("stratus:comparison", metadata.comparison);
	if (clamped)
		spec.attribute("stratus:clamped_to", half_max);
	return spec;
}

void describe_frame(ImageSpec &spec, const struct frame &frame)
{
	spec.attribute("stratus:exposure_ev", static_cast<float>(frame.exposure_ev));
	if (frame.samples == 0) { /* those of a reference would be the slab's, and its picture has others */
		spec.attribute("stratus:global_illuminance_lux", static_cast<float>(frame.global_illuminance_lux));
		spec.attribute("stratus:direct_illuminance_lux", static_cast<float>(frame.direct_illuminance_lux));
		spec.attribute("stratus:diffuse_illuminance_lux", static_cast<float>(frame.diffuse_illuminance_lux));
	}
	if (frame.samples > 0) {
		spec.attribute("stratus:samples", frame.samples);
		spec.attribute("stratus:partial", frame.partial ? 1 : 0);
	}
}

/* Rows y..y_end as the file has them: pixel by pixel, each channel in its own type. */
void pack_rows(int width, const std::vector<channel> &channels, int y, int y_end, bytes &packed)
{
	size_t pixel_bytes = 0;
	for (const channel &channel : channels)
		pixel_bytes += channel.is_half ? 2 : 4;
	const size_t first = static_cast<size_t>(y) * width, count = static_cast<size_t>(y_end - y) * width;
	packed.resize(pixel_bytes * count);

	size_t offset = 0;
	for (const channel &channel : channels) {
		const float *from = channel.first + first * channel.stride;
		unsigned char *to = packed.data() + offset;
		for (size_t i = 0; i < count; i++, from += channel.stride, to += pixel_bytes) {
			if (channel.is_half) {
				const half value(std::min(std::max(*from, -half_max), half_max));
				std::memcpy(to, &value, 2);
			} else {
				std::memcpy(to, from, 4);
			}
		}
		offset += channel.is_half ? 2 : 4;
	}
}

bytes write_exr(const ImageSpec &spec, const std::vector<channel> &channels, const struct image_watch *watch)
{
	OIIO::Filesystem::IOVecOutput proxy;
	auto out = open_output("exr", spec, &proxy);
	bytes rows;
	for (int y = 0; y < spec.height; y += rows_at_once) {
		require(is_wanted(watch), unwanted);
		const int y_end = std::min(y + rows_at_once, spec.height);
		pack_rows(spec.width, channels, y, y_end, rows);
		if (!out->write_scanlines(y, y_end, 0, TypeDesc::UNKNOWN, rows.data()))
			throw std::runtime_error(out->geterror());
	}
	close_output(*out);
	return std::move(proxy.buffer());
}

bytes encode_exr(const struct frame &frame, const struct scene &scene, const struct image_metadata &metadata,
		 const struct image_watch *watch)
{
	require(frame.type == PIXEL_F32, "an EXR needs a scene-linear frame");
	const picture_size size = {frame.width, frame.height};
	std::vector<channel> channels = list_channels(frame);
	const bool clamped = choose_types(size, scene.output.exr_type, channels);
	ImageSpec spec = exr_spec(size, scene, metadata, channels, clamped);
	describe_frame(spec, frame);
	return write_exr(spec, channels, watch);
}

bytes encode_exr_planes(const struct image_planes &planes, const struct scene &scene, const struct image_metadata &metadata,
			const struct image_watch *watch)
{
	require(planes.width >= 1 && planes.height >= 1 && planes.count >= 1, "there are no planes");
	const picture_size size = {planes.width, planes.height};
	std::vector<channel> channels = list_channels(planes);
	const bool clamped = choose_types(size, scene.output.exr_type, channels);
	return write_exr(exr_spec(size, scene, metadata, channels, clamped), channels, watch);
}

/* --- reading --------------------------------------------------------------------------------------------------------------- */

/* The pieces of a file that its reader is to see, as one. */
class picture_source : public OIIO::Filesystem::IOProxy
{
      public:
	picture_source(int fd, const struct picture_file &file) : IOProxy("picture", Read), fd(fd), file(file)
	{
		for (size_t i = 0; i < file.piece_count; i++) {
			starts.push_back(total);
			total += file.pieces[i].size;
		}
	}

	const char *proxytype() const override
	{
		return "picture";
	}

	size_t size() const override
	{
		return total;
	}

	size_t read(void *buffer, size_t count) override
	{
		const size_t got = pread(buffer, count, m_pos);
		m_pos += static_cast<int64_t>(got);
		return got;
	}

	size_t pread(void *buffer, size_t count, int64_t offset) override
	{
		size_t got = 0;
		while (got < count && offset >= 0 && static_cast<uint64_t>(offset) + got < total) {
			const size_t more = read_piece(static_cast<char *>(buffer) + got, count - got, static_cast<uint64_t>(offset) + got);
			if (more == 0)
				break;
			got += more;
		}
		return got;
	}

      private:
	/* Reads no further than the piece reaches that holds the place. */
	size_t read_piece(char *buffer, size_t count, uint64_t place)
	{
		const size_t i = static_cast<size_t>(std::upper_bound(starts.begin(), starts.end(), place) - starts.begin()) - 1;
		const uint64_t inside = place - starts[i];
		const size_t wanted = static_cast<size_t>(std::min<uint64_t>(count, file.pieces[i].size - inside));
		const ssize_t got = ::pread(fd, buffer, wanted, static_cast<off_t>(file.pieces[i].offset + inside));
		return got > 0 ? static_cast<size_t>(got) : 0;
	}

	int fd;
	const struct picture_file &file;
	std::vector<uint64_t> starts; /* of the pieces, as the reader counts */
	uint64_t total = 0;
};

/* The channels that make the picture: R, G, B (and A), or Y (and A), or the only one. OpenImageIO puts these first, in this order. */
struct channel_range {
	int first, count;
};

channel_range choose_input_channels(const ImageSpec &spec)
{
	const auto index = [&](const char *name) {
		const auto found = std::find(spec.channelnames.begin(), spec.channelnames.end(), name);
		return found == spec.channelnames.end() ? -1 : static_cast<int>(found - spec.channelnames.begin());
	};
	const int r = index("R"), y = index("Y"), a = index("A");
	if (r >= 0 && index("G") == r + 1 && index("B") == r + 2)
		return {r, a == r + 3 ? 4 : 3};
	if (y >= 0 && r < 0 && index("RY") < 0)
		return {y, a == y + 1 ? 2 : 1};
	require(spec.nchannels == 1, "it has neither channels R, G, B nor one Y, nor one channel alone");
	return {0, 1};
}

std::unique_ptr<ImageInput> open_input(enum image_format format, OIIO::Filesystem::IOProxy *proxy, ImageSpec &spec)
{
	const char *name = scene_format_names[format];
	/* By its name: the readers of other formats are not even asked. */
	auto in = ImageInput::create(name);
	if (!in)
		throw std::runtime_error(OIIO::geterror());
	ImageSpec config;
	config.attribute("oiio:UnassociatedAlpha", 1);
	in->threads(1);
	in->set_ioproxy(proxy);
	if (!in->open(std::string("picture.") + name, spec, config))
		throw std::runtime_error(in->geterror());
	return in;
}

void read_rows(ImageInput &in, const ImageSpec &spec, channel_range channels, int y, int y_end, float *values)
{
	const int first = spec.y + y, end = spec.y + y_end, c = channels.first, c_end = c + channels.count;
	const bool done = spec.tile_height > 0
				  ? in.read_tiles(0, 0, spec.x, spec.x + spec.width, first, end, 0, 1, c, c_end, TypeDesc::FLOAT, values)
				  : in.read_scanlines(0, 0, first, end, 0, c, c_end, TypeDesc::FLOAT, values);
	if (!done)
		throw std::runtime_error(in.geterror());
}

void decode_picture(int fd, const struct picture_file &file, image_rows_taker *take, void *context)
{
	picture_source source(fd, file);
	ImageSpec spec;
	auto in = open_input(file.format, &source, spec);
	require(spec.width == file.width && spec.height == file.height && spec.depth == 1, "its size is not what its header says");
	const channel_range channels = file.format == IMAGE_PNG ? channel_range{0, spec.nchannels} : choose_input_channels(spec);
	require(channels.count >= 1 && channels.count <= 4, "it has more than four channels");
	/* The reader of PNG holds what lies together by itself. */
	const int block = spec.tile_height > 0 ? spec.tile_height : file.format == IMAGE_EXR ? file.row_block : 1;
	constexpr int rows_at_least = 16;
	const int step = std::min((rows_at_least + block - 1) / block * block, file.height);
	std::vector<float> values(static_cast<size_t>(step) * file.width * channels.count);
	for (int y = 0; y < file.height; y += step) {
		const int y_end = std::min(y + step, file.height);
		read_rows(*in, spec, channels, y, y_end, values.data());
		const struct image_rows rows = {y, y_end - y, channels.count, values.data()};
		require(take(context, &rows), "it was not taken");
	}
}

/* --- the doors to C ------------------------------------------------------------------------------------------------------- */

void check_frame(const struct frame &frame)
{
	static const size_t sample_bytes[] = {1, 2, 4};
	require(frame.width >= 1 && frame.height >= 1 && frame.channels == 3, "the frame has no RGB pixels");
	require(frame.layer_count >= 1 && frame.layer_count <= LAYER_COUNT, "the frame has no layers");
	const size_t needed = sample_bytes[frame.type] * 3 * frame.width * frame.height * frame.layer_count;
	require(frame.pixels && frame.bytes >= needed, "the frame holds fewer pixels than its size says");
}

/* Runs an encoder and hands over what it wrote. */
template <typename Encoder> bool deliver(struct image_buffer *buffer, char *error, size_t error_size, const Encoder &encoder) noexcept
{
	*buffer = {};
	try {
		const bytes file = encoder();
		buffer->data = static_cast<unsigned char *>(std::malloc(file.size()));
		require(buffer->data, "out of memory");
		std::memcpy(buffer->data, file.data(), file.size());
		buffer->size = file.size();
		return true;
	} catch (const std::exception &failure) {
		std::snprintf(error, error_size, "%s", failure.what());
	} catch (...) {
		std::snprintf(error, error_size, "unknown failure of the image library");
	}
	return false;
}

bool encode(const struct frame *frame, const struct scene *scene, const struct image_metadata *metadata, const struct image_watch *watch,
	    struct image_buffer *buffer, char *error, size_t error_size) noexcept
{
	return deliver(buffer, error, error_size, [&] {
		check_frame(*frame);
		return scene->output.format == IMAGE_PNG ? encode_png(*frame, *scene, *metadata, watch)
							 : encode_exr(*frame, *scene, *metadata, watch);
	});
}

bool encode_planes(const struct image_planes *planes, const struct scene *scene, const struct image_metadata *metadata,
		   const struct image_watch *watch, struct image_buffer *buffer, char *error, size_t error_size) noexcept
{
	return deliver(buffer, error, error_size, [&] { return encode_exr_planes(*planes, *scene, *metadata, watch); });
}

bool decode(int fd, const struct picture_file *file, image_rows_taker *take, void *context, char *error, size_t error_size) noexcept
{
	try {
		decode_picture(fd, *file, take, context);
		return true;
	} catch (const std::exception &failure) {
		std::snprintf(error, error_size, "%s", failure.what());
	} catch (...) {
		std::snprintf(error, error_size, "unknown failure of the image library");
	}
	return false;
}

const struct image_api api = {"OpenImageIO " OIIO_VERSION_STRING ", zlib " ZLIB_VERSION, encode, encode_planes, decode};

} // namespace

/* One encode stays on one thread: several run at once beside the renderer, and would only take turns. */
extern "C" const struct image_api *stratus_image_api(void)
{
	static std::once_flag once;
	std::call_once(once, [] {
		OIIO::attribute("threads", 1);
		OIIO::attribute("exr_threads", -1);
		OIIO::attribute("debug", 0); /* no lines on standard error that are not ours */
	});
	return &api;
}
