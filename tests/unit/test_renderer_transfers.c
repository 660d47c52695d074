/* Pictures on their way from the renderer to memory: they arrive as the same bytes, whatever else is rendered or dropped meanwhile. */
#include "tests/unit/test_renderer_common.h"

#include <pthread.h>
#include <time.h>

enum { MORE_THAN_PLACES = RENDERER_TRANSFERS_MAX + 2 };

static struct frame start(const struct scene *scene)
{
	struct render_pending *pending = NULL;
	struct frame frame;
	assert_int_equal(renderer_start(renderer, scene, NULL, NULL, NULL, &pending, &frame), RENDER_OK);
	assert_null(pending);
	return frame;
}

static void await(struct frame *frame)
{
	enum render_result result;
	while ((result = renderer_arrive(renderer, frame, 10)) == RENDER_UNFINISHED)
		;
	assert_int_equal(result, RENDER_OK);
}

static void assert_same_picture(const struct frame *frame, const struct frame *expected)
{
	assert_int_equal(frame->bytes, expected->bytes);
	assert_non_null(frame->pixels);
	assert_memory_equal(frame->pixels, expected->pixels, expected->bytes);
}

static struct scene turned(int azimuth)
{
	struct scene scene = small_scene(40, 30, LAYER(COLOR) | LAYER(SKY) | LAYER(DISTANCE));
	scene.camera.azimuth_deg = azimuth;
	return scene;
}

/* As many as there are places travel, the others are waited for; those that come after find the places again. */
static void pictures_travel_together(void **state)
{
	(void)state;
	struct frame frames[MORE_THAN_PLACES], expected[MORE_THAN_PLACES];
	struct scene scenes[MORE_THAN_PLACES];
	for (int i = 0; i < MORE_THAN_PLACES; i++) {
		scenes[i] = turned(40 * i);
		expected[i] = render(&scenes[i]);
		assert_null(expected[i].transfer);
	}
	for (int round = 0; round < 3; round++) {
		for (int i = 0; i < MORE_THAN_PLACES; i++) {
			frames[i] = start(&scenes[i]);
			assert_int_equal(frames[i].transfer != NULL, i < RENDERER_TRANSFERS_MAX);
			assert_int_equal(frames[i].pixels == NULL, i < RENDERER_TRANSFERS_MAX);
		}
		for (int i = MORE_THAN_PLACES - 1; i >= 0; i--) { /* the last first: its fence is behind the others' */
			await(&frames[i]);
			assert_true(frame_take_pixels(&frames[i]));
			assert_null(frames[i].transfer);
			assert_same_picture(&frames[i], &expected[i]);
			assert_true(frame_take_pixels(&frames[i])); /* once more is nothing */
			frame_finish(&frames[i]);
		}
	}
	for (int i = 0; i < MORE_THAN_PLACES; i++)
		frame_finish(&expected[i]);
}

/* What is dropped on its way gives its place back, and its pixels are seen nowhere. */
static void a_dropped_picture_spoils_nothing(void **state)
{
	(void)state;
	const struct scene one = turned(5), other = turned(95);
	struct frame expected = render(&other);
	for (int i = 0; i < 4 * RENDERER_TRANSFERS_MAX; i++) {
		struct frame dropped = start(&one), frame = start(&other);
		assert_non_null(dropped.transfer);
		frame_finish(&dropped);
		await(&frame);
		assert_true(frame_take_pixels(&frame));
		assert_same_picture(&frame, &expected);
		frame_finish(&frame);
	}
	frame_finish(&expected);
}

/* By each of the two ways: through a buffer, and, once no place is left, at once. */
static void every_type_arrives_as_it_is(void **state)
{
	(void)state;
	struct scene scene = turned(200), filler = turned(1);
	struct frame fillers[RENDERER_TRANSFERS_MAX];
	for (int form = 0; form < 3; form++) {
		scene.output.format = form < 2 ? IMAGE_PNG : IMAGE_EXR;
		scene.output.bits = form == 1 ? 16 : 8;
		scene.output.width = 37; /* rows of odd lengths */
		struct frame frame = start(&scene);
		assert_non_null(frame.transfer);
		await(&frame);
		assert_true(frame_take_pixels(&frame));
		for (int i = 0; i < RENDERER_TRANSFERS_MAX; i++)
			fillers[i] = start(&filler);
		struct frame at_once = start(&scene);
		assert_null(at_once.transfer);
		assert_same_picture(&at_once, &frame);
		const int bytes = form == 0 ? 1 : form == 1 ? 2 : 4;
		assert_int_equal(frame.bytes, 37 * 30 * 3 * bytes * (form == 2 ? 3 : 1));
		frame_finish(&at_once);
		frame_finish(&frame);
		for (int i = 0; i < RENDERER_TRANSFERS_MAX; i++)
			frame_finish(&fillers[i]);
	}
}

/* Larger than a buffer may be: 16 layers of 512 x 512 would be 64 MB. */
static void a_large_picture_is_waited_for(void **state)
{
	(void)state;
	struct scene scene = small_scene(512, 512, (1u << LAYER_COUNT) - 1);
	scene.output.layers &= ~LAYER(STANDARD_ERROR);
	scene.camera.elevation_deg = 80;
	const size_t bytes = (size_t)512 * 512 * 16 * (size_t)__builtin_popcount(scene.output.layers);
	assert_true(bytes > 48 << 20);
	struct frame whole = start(&scene);
	assert_null(whole.transfer);
	/* Each layer where it belongs: the parts are the picture. */
	for (int y = 0; y < 512; y += 73)
		for (int x = 0; x < 512; x += 37) {
			double sum = 0, size = 0;
			for (int layer = LAYER_SUN_DIRECT; layer <= LAYER_AIR; layer++) {
				sum += (double)pixel_of(&whole, layer, x, y)[1];
				size += fabs((double)pixel_of(&whole, layer, x, y)[1]);
			}
			assert_true(size > 0 && fabs((double)pixel_of(&whole, LAYER_COLOR, x, y)[1] - sum) <= 2e-6 * size);
		}
	frame_finish(&whole);
}

/* A thread without OpenGL takes the pixels, while this one renders on. */
static void *take(void *argument)
{
	return frame_take_pixels(argument) ? argument : NULL;
}

static void any_thread_takes_the_pixels(void **state)
{
	(void)state;
	const struct scene one = turned(11), other = turned(12);
	struct frame expected = render(&one);
	for (int i = 0; i < 8; i++) {
		pthread_t thread;
		void *taken;
		struct frame frame = start(&one);
		await(&frame);
		assert_int_equal(pthread_create(&thread, NULL, take, &frame), 0);
		struct frame meanwhile = render(&other);
		pthread_join(thread, &taken);
		assert_non_null(taken);
		assert_same_picture(&frame, &expected);
		frame_finish(&meanwhile);
		frame_finish(&frame);
	}
	frame_finish(&expected);
}

/* One picture arrives between the passes of another, and neither takes the other's times. */
static bool look_for_arrival(void *context)
{
	struct frame *frame = context;
	if (!frame->transfer || frame->pixels)
		return false;
	if (renderer_arrive(renderer, frame, 0) == RENDER_OK)
		assert_true(frame_take_pixels(frame));
	return false;
}

/* Whether it arrived in time for that, and the times are told apart: one has fifty times the pixels of the other. */
static bool one_arrived(struct scene one, struct scene other)
{
	struct render_pending *pending = NULL;
	struct frame second;
	one.camera.roll_deg = other.camera.roll_deg = 1; /* the pictures are new */
	one.output.width = 400, one.output.height = 300;
	one.output.layers = other.output.layers = LAYER(COLOR);
	struct frame first = start(&one);
	assert_non_null(first.transfer);
	assert_int_equal(renderer_start(renderer, &other, look_for_arrival, NULL, &first, &pending, &second), RENDER_OK);
	const bool arrived = first.pixels;
	if (!arrived) {
		await(&first);
		assert_true(frame_take_pixels(&first));
	}
	await(&second);
	assert_true(frame_take_pixels(&second));
	struct frame again = render(&one);
	assert_same_picture(&first, &again);
	assert_true(second.timing[STAGE_VIEW].milliseconds > 0 && first.timing[STAGE_READBACK].milliseconds > 0);
	const bool apart = first.timing[STAGE_VIEW].milliseconds > 2 * second.timing[STAGE_VIEW].milliseconds;
	frame_finish(&again);
	frame_finish(&second);
	frame_finish(&first);
	return arrived && apart;
}

/* A busy machine may hold either up: in some of a few tries. */
static void one_arrives_while_another_is_rendered(void **state)
{
	(void)state;
	bool arrived = false;
	for (int i = 0; i < 8 && !arrived; i++)
		arrived = one_arrived(turned(21 + 2 * i), turned(22 + 2 * i));
	assert_true(arrived);
}

/* The buffers go with the renderer, but not from under who reads them. */
static void *take_late(void *argument)
{
	nanosleep(&(struct timespec){.tv_nsec = 50000000}, NULL);
	return take(argument);
}

static void a_renderer_waits_for_its_pictures(void **state)
{
	(void)state;
	const struct scene scene = turned(30);
	struct frame expected = render(&scene);
	pthread_t thread;
	void *taken;
	struct frame frame = start(&scene);
	await(&frame);
	assert_int_equal(pthread_create(&thread, NULL, take_late, &frame), 0);
	renderer_destroy(renderer);
	pthread_join(thread, &taken);
	assert_non_null(taken);
	assert_same_picture(&frame, &expected);
	renderer = create_renderer(0);
	assert_non_null(renderer);
	frame_finish(&frame);
	frame_finish(&expected);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(pictures_travel_together),          cmocka_unit_test(a_dropped_picture_spoils_nothing),
		cmocka_unit_test(every_type_arrives_as_it_is),       cmocka_unit_test(a_large_picture_is_waited_for),
		cmocka_unit_test(any_thread_takes_the_pixels),       cmocka_unit_test(one_arrives_while_another_is_rendered),
		cmocka_unit_test(a_renderer_waits_for_its_pictures),
	};
	return RUN_WITH_RENDERER(tests);
}
