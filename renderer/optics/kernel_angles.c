/* The grids of the kernel table. */
#include "renderer/optics/kernel_table.h"

#include "renderer/optics/quadrature.h"

#include <math.h>

double kernel_node_x(int node)
{
	return KERNEL_X_MIN * exp(KERNEL_LOG_STEP * node);
}

/* theta = low + (high - low) ((1 - stretch) t + stretch t^2). Gauss-Legendre nodes crowd at both ends of a panel by themselves; the
 * stretch adds to the end that faces the forward (and, mirrored, the backward) direction, where P is steepest. */
struct panel {
	double low, high, stretch;
};

static const struct panel peak_panel = {0, FORWARD_PEAK_ANGLE, 0.5};
static const struct panel body_panel = {FORWARD_PEAK_ANGLE, M_PI_2, 0.3};

double kernel_panel_angle(bool peak, double t, double *slope)
{
	const struct panel *panel = peak ? &peak_panel : &body_panel;
	double extent = panel->high - panel->low;
	*slope = extent * (1 - panel->stretch + 2 * panel->stretch * t);
	return panel->low + extent * t * (1 - panel->stretch + panel->stretch * t);
}

static void fill_panel(struct kernel_payload *payload, bool peak, int first_pair, int count)
{
	double node[KERNEL_BODY_COUNT], weight[KERNEL_BODY_COUNT];
	quadrature_gauss(count, node, weight);
	for (int i = 0; i < count; i++) {
		double slope;
		double angle = kernel_panel_angle(peak, node[i], &slope);
		int pair = first_pair + i, mirror = KERNEL_ANGLE_COUNT - 1 - pair;
		payload->angle[pair] = angle;
		payload->angle[mirror] = M_PI - angle;
		payload->weight[pair] = payload->weight[mirror] = weight[i] * slope * sin(angle);
	}
}

void kernel_fill_angles(struct kernel_payload *payload)
{
	payload->angle[0] = payload->weight[0] = 0;
	payload->angle[KERNEL_ANGLE_COUNT - 1] = M_PI;
	payload->weight[KERNEL_ANGLE_COUNT - 1] = 0;
	fill_panel(payload, true, 1, KERNEL_PEAK_COUNT);
	fill_panel(payload, false, 1 + KERNEL_PEAK_COUNT, KERNEL_BODY_COUNT);
}
