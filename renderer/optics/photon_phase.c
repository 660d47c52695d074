#include "renderer/optics/photon_phase.h"

enum { BINS = PHOTON_ZONE_BINS };

_Static_assert(PHOTON_ZONE_COUNT *BINS <= UINT16_MAX, "a guide holds any bin");

static uint64_t splitmix(uint64_t *state)
{
	uint64_t z = *state += 0x9e3779b97f4a7c15;
	z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
	z = (z ^ z >> 27) * 0x94d049bb133111eb;
	return z ^ z >> 31;
}

void photon_random_start(struct photon_random *random, uint64_t seed, uint64_t number)
{
	uint64_t state = splitmix(&seed) + number;
	state = splitmix(&state);
	for (int i = 0; i < 4; i++)
		random->state[i] = splitmix(&state);
}

/* --- the table ----------------------------------------------------------------------------------------------------------------- */

/* Sine or cosine, squared, at a node: from 0 to 1 over the front and back of the sphere, half of which is at 90 degrees. */
static double node_square(const struct photon_phase *phase, int zone, int node)
{
	double x = phase->start[zone] + phase->step[zone] * node;
	return x * x;
}

static void fill_values(struct photon_phase *phase, const struct optics *optics, int band, enum slab_phase which)
{
	const double edge = sin(FORWARD_PEAK_ANGLE / 2), right = sqrt(0.5);
	const double start[] = {0, edge, 0}, end[] = {edge, right, right};
	for (int zone = 0; zone < PHOTON_ZONE_COUNT; zone++) {
		phase->start[zone] = start[zone];
		phase->step[zone] = (end[zone] - start[zone]) / BINS;
		for (int node = 0; node <= BINS; node++) {
			double x = start[zone] + phase->step[zone] * node, angle = 2 * asin(x);
			bool none = zone == PHOTON_PEAK && which == SLAB_PHASE_MODIFIED;
			phase->value[zone][node] = none ? 0 : optics_phase(optics, band, zone == PHOTON_BACK ? M_PI - angle : angle);
		}
	}
}

/* Probabilities: the integral of P over the square, which is the integral over the cosine and half of it. */
static void normalise(struct photon_phase *phase)
{
	double sum = 0;
	for (int zone = 0, bin = 0; zone < PHOTON_ZONE_COUNT; zone++)
		for (int i = 0; i < BINS; i++, bin++) {
			double width = node_square(phase, zone, i + 1) - node_square(phase, zone, i);
			phase->below[bin] = sum;
			sum += (phase->value[zone][i] + phase->value[zone][i + 1]) / 2 * width;
		}
	phase->below[PHOTON_ZONE_COUNT * BINS] = sum;
	for (int bin = 0; bin <= PHOTON_ZONE_COUNT * BINS; bin++)
		phase->below[bin] /= sum;
	for (int zone = 0; zone < PHOTON_ZONE_COUNT; zone++)
		for (int node = 0; node <= BINS; node++)
			phase->value[zone][node] /= sum;
}

static void fill_guide(struct photon_phase *phase)
{
	int bin = 0;
	for (int cell = 0; cell < PHOTON_GUIDE_CELLS; cell++) {
		while (phase->below[bin + 1] <= (double)cell / PHOTON_GUIDE_CELLS)
			bin++;
		phase->guide[cell] = (uint16_t)bin;
	}
}

static void fill_lines(const struct photon_phase *phase, int zone, struct photon_line *line)
{
	for (int i = 0; i < BINS; i++) {
		double low = node_square(phase, zone, i), high = node_square(phase, zone, i + 1);
		double slope = (phase->value[zone][i + 1] - phase->value[zone][i]) / (high - low);
		line[i] = (struct photon_line){(float)(phase->value[zone][i] - slope * low), (float)slope};
	}
	line[BINS] = line[BINS - 1];
}

void photon_phase_fill(struct photon_phase *phase, const struct optics *optics, int band, enum slab_phase which)
{
	fill_values(phase, optics, band, which);
	normalise(phase);
	fill_guide(phase);
	fill_lines(phase, PHOTON_PEAK, phase->peak);
	phase->body[0] = (struct photon_line){0, 0};
	fill_lines(phase, PHOTON_FRONT, &phase->body[PHOTON_BODY_FRONT]);
	fill_lines(phase, PHOTON_BACK, &phase->body[PHOTON_BODY_BACK]);
	phase->edge = (float)phase->start[PHOTON_FRONT];
	phase->peak_per_step = (float)(1 / phase->step[PHOTON_PEAK]);
	phase->front_per_step = (float)(1 / phase->step[PHOTON_FRONT]);
	phase->back_per_step = (float)(1 / phase->step[PHOTON_BACK]);
}

/* --- directions ---------------------------------------------------------------------------------------------------------------- */

struct photon_angle photon_phase_draw(const struct photon_phase *phase, struct photon_random *random)
{
	double u = photon_random_unit(random);
	int bin = phase->guide[(int)(u * PHOTON_GUIDE_CELLS)];
	while (phase->below[bin + 1] <= u)
		bin++;
	int zone = bin / BINS, i = bin % BINS;
	double share = (u - phase->below[bin]) / (phase->below[bin + 1] - phase->below[bin]);
	double first = phase->value[zone][i], last = phase->value[zone][i + 1];
	double t = share * (first + last) / (first + sqrt(first * first + share * (last * last - first * first)));
	double low = node_square(phase, zone, i), square = low + t * (node_square(phase, zone, i + 1) - low);
	return (struct photon_angle){
		.cosine = zone == PHOTON_BACK ? 2 * square - 1 : 1 - 2 * square,
		.sine = 2 * sqrt(square * (1 - square)),
		.peak = zone == PHOTON_PEAK,
	};
}

void photon_turn(double direction[3], struct photon_angle angle, struct photon_random *random)
{
	/* A point in the unit circle has the direction wanted, without sine and cosine (J. von Neumann 1951). */
	double a, b, square;
	do {
		a = 2 * photon_random_unit(random) - 1;
		b = 2 * photon_random_unit(random) - 1;
		square = a * a + b * b;
	} while (square > 1 || square < 1e-20);
	double across = angle.sine / sqrt(square);
	a *= across;
	b *= across;
	/* Two vectors across the direction (T. Duff et al. 2017, J. Comput. Graph. Tech. 6, 1). */
	double x = direction[0], y = direction[1], z = direction[2];
	double sign = copysign(1, z), c = -1 / (sign + z), d = x * y * c;
	double turned[3] = {
		angle.cosine * x + a * (1 + sign * x * x * c) + b * d,
		angle.cosine * y + a * sign * d + b * (sign + y * y * c),
		angle.cosine * z - a * sign * x - b * y,
	};
	/* A step of Newton's towards length 1. */
	double scale = 1.5 - 0.5 * (turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2]);
	for (int i = 0; i < 3; i++)
		direction[i] = scale * turned[i];
}
