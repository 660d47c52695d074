#include "clients/bench/sweep.h"

#include "clients/bench/report.h"

#include <math.h>
#include <string.h>

enum { CLOSED_CONNECTIONS = 4, HALVINGS = 3, DESCENTS = 8, LAST_ANSWERS = 4 };
static const double GROWTH = 1.5, GOOD_SHARE = 0.99, RATE_SHARE = 0.95;

static double number(const json_t *report, const char *name)
{
	return json_number_value(json_object_get(report, name));
}

static double latency_ms(const json_t *report, const char *share)
{
	return 1000 * json_number_value(json_object_get(json_object_get(report, "good"), share));
}

/* usual_ms: the least median of all steps, which the last answers may take some times over without anything having piled up. */
static bool is_borne(const struct sweep_settings *settings, const json_t *report, double usual_ms)
{
	const double good = json_number_value(json_object_get(json_object_get(report, "good"), "count"));
	const double latest_s = settings->load.duration_s / RATE_SHARE + LAST_ANSWERS * usual_ms / 1000;
	return good >= GOOD_SHARE * number(report, "asked") && number(report, "good_until_s") <= latest_s &&
	       (settings->p99_ms <= 0 || latency_ms(report, "p99_s") <= settings->p99_ms);
}

/* --- steps ------------------------------------------------------------------------------------------------------------------------------
 */

static int measure(const struct client *client, struct mix *mix, const struct load_settings *load, json_t **report)
{
	struct load_result result;
	int status = load_run(client, mix, load, &result);
	*report = status == CLIENT_OK ? report_json(load, mix, &result) : NULL;
	load_result_finish(&result);
	if (status == CLIENT_OK && !*report) {
		client_error("out of memory");
		status = CLIENT_USAGE;
	}
	return status;
}

static void insert(struct sweep *sweep, const struct sweep_step *step)
{
	int at = sweep->steps++;
	for (; at > 0 && sweep->step[at - 1].rate > step->rate; at--)
		sweep->step[at] = sweep->step[at - 1];
	sweep->step[at] = *step;
	if (step->borne && step->rate > sweep->knee)
		sweep->knee = step->rate;
	if (!step->borne && (sweep->beyond == 0 || step->rate < sweep->beyond))
		sweep->beyond = step->rate;
}

/* Every step draws scenes of its own, so that none is known from the one before. */
static int take_step(const struct client *client, struct mix *mix, const struct sweep_settings *settings, double rate, struct sweep *sweep)
{
	struct load_settings load = settings->load;
	struct sweep_step step = {.rate = rate};
	load.rate = rate;
	load.seed += sweep->steps + 1;
	const int status = measure(client, mix, &load, &step.report);
	if (status != CLIENT_OK)
		return status;
	const double median_ms = latency_ms(step.report, "p50_s");
	if (median_ms > 0 && (sweep->usual_ms == 0 || median_ms < sweep->usual_ms))
		sweep->usual_ms = median_ms;
	step.borne = is_borne(settings, step.report, sweep->usual_ms);
	insert(sweep, &step);
	if (!client->quiet)
		fprintf(stderr, "%.4g requests/s %s: %.4g/s good, p99 %.4g ms\n", rate, step.borne ? "borne" : "not borne",
			number(step.report, "good_per_s"), latency_ms(step.report, "p99_s"));
	return CLIENT_OK;
}

static int find_first_rate(const struct client *client, struct mix *mix, const struct sweep_settings *settings, double *rate)
{
	struct load_settings load = settings->load;
	json_t *report;
	*rate = settings->load.rate;
	if (*rate > 0)
		return CLIENT_OK;
	load.connections = CLOSED_CONNECTIONS;
	load.random_arrivals = false;
	const int status = measure(client, mix, &load, &report);
	*rate = number(report, "good_per_s") / 4;
	json_decref(report);
	if (status == CLIENT_OK && *rate <= 0) {
		client_error("nothing is answered well: stratus bench without --sweep shows what is");
		return CLIENT_REFUSED;
	}
	return status;
}

int sweep_run(const struct client *client, struct mix *mix, const struct sweep_settings *settings, struct sweep *sweep)
{
	double rate;
	*sweep = (struct sweep){0};
	int status = find_first_rate(client, mix, settings, &rate);
	/* Up until it is too much, or down until it is not. */
	for (int i = 0; status == CLIENT_OK && i < SWEEP_STEPS_MAX - HALVINGS && (sweep->knee == 0 || sweep->beyond == 0); i++) {
		if (sweep->knee == 0 && i > DESCENTS)
			break;
		status = take_step(client, mix, settings, rate, sweep);
		rate = sweep->beyond > 0 ? rate / 2 : rate * GROWTH;
	}
	for (int i = 0; status == CLIENT_OK && i < HALVINGS && sweep->knee > 0 && sweep->beyond > sweep->knee; i++)
		status = take_step(client, mix, settings, sqrt(sweep->knee * sweep->beyond), sweep);
	if (status == CLIENT_OK && sweep->knee == 0) {
		client_error("not even %.3g requests/s are borne", sweep->step[0].rate);
		status = CLIENT_REFUSED;
	}
	return status;
}

/* --- results ----------------------------------------------------------------------------------------------------------------------------
 */

void sweep_print(FILE *to, const struct sweep *sweep)
{
	static const char *const shares[] = {"p50_s", "p90_s", "p99_s", "p99_9_s"};
	fprintf(to, "%10s %10s %10s %10s %10s %10s %8s %7s\n", "asked/s", "good/s", "p50 ms", "p90 ms", "p99 ms", "p99.9 ms", "refused",
		"errors");
	for (int i = 0; i < sweep->steps; i++) {
		const json_t *report = sweep->step[i].report;
		const json_int_t refused = json_integer_value(json_object_get(json_object_get(report, "refused"), "count"));
		const json_int_t other = json_integer_value(json_object_get(json_object_get(report, "other"), "count"));
		fprintf(to, "%10.2f %10.2f", number(report, "asked_per_s"), number(report, "good_per_s"));
		for (size_t s = 0; s < sizeof shares / sizeof *shares; s++)
			fprintf(to, " %10.2f", latency_ms(report, shares[s]));
		fprintf(to, " %8lld %7.0f%s\n", (long long)refused, number(report, "errors") + (double)other,
			sweep->step[i].borne ? "" : "  not borne");
	}
	if (sweep->knee > 0)
		fprintf(to, "\nknee: %.4g requests/s are borne", sweep->knee);
	else
		fputs("\nknee: none of these is borne", to);
	if (sweep->beyond > 0)
		fprintf(to, ", %.4g are not", sweep->beyond);
	fputc('\n', to);
}

json_t *sweep_json(const struct sweep *sweep)
{
	json_t *steps = json_array();
	for (int i = 0; i < sweep->steps; i++)
		json_array_append_new(steps, json_pack("{s:f, s:b, s:O}", "rate_per_s", sweep->step[i].rate, "borne", sweep->step[i].borne,
						       "report", sweep->step[i].report));
	return json_pack("{s:f, s:f, s:o}", "knee_per_s", sweep->knee, "beyond_per_s", sweep->beyond, "steps", steps);
}

void sweep_finish(struct sweep *sweep)
{
	for (int i = 0; i < sweep->steps; i++)
		json_decref(sweep->step[i].report);
	*sweep = (struct sweep){0};
}
