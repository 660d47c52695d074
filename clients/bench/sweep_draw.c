#include "clients/bench/sweep.h"
#include "clients/plot.h"

static const struct curve {
	const char *share, *title, *colour;
} curves[] = {{"p50_s", "median", PLOT_BLUE}, {"p90_s", "p90", PLOT_GREEN}, {"p99_s", "p99", PLOT_ORANGE}, {"max_s", "longest", PLOT_RED}};

enum { CURVES = sizeof curves / sizeof *curves };

/* Rows "asked good p50 ...", in requests/s and ms, as a block that the figure's parts share. */
static void write_data(FILE *to, const struct sweep *sweep)
{
	fputs("$steps << EOD\n", to);
	for (int i = 0; i < sweep->steps; i++) {
		const json_t *report = sweep->step[i].report, *good = json_object_get(report, "good");
		fprintf(to, "%.6g %.6g", json_number_value(json_object_get(report, "asked_per_s")),
			json_number_value(json_object_get(report, "good_per_s")));
		for (int c = 0; c < CURVES; c++) {
			const double seconds = json_number_value(json_object_get(good, curves[c].share));
			if (seconds > 0)
				fprintf(to, " %.6g", 1000 * seconds);
			else
				fputs(" NaN", to);
		}
		fputc('\n', to);
	}
	fputs("EOD\n", to);
}

static void write_latencies(FILE *to)
{
	fputs("set origin 0,0.4; set size 1,0.6; set logscale y; set ylabel 'latency since due, ms'\n"
	      "set key outside top center horizontal\nplot ",
	      to);
	for (int c = 0; c < CURVES; c++)
		fprintf(to, "%s$steps using 1:%d with linespoints pt 7 ps 0.6 lw 1.8 lc rgb '%s' title '%s'", c ? ", " : "", 3 + c,
			curves[c].colour, curves[c].title);
	fputc('\n', to);
}

int sweep_draw(const struct sweep *sweep, const char *path)
{
	struct plot plot;
	if (!plot_begin(&plot, path, 800, 640))
		return CLIENT_UNWRITABLE;
	write_data(plot.to, sweep);
	fprintf(plot.to, "set multiplot; set lmargin 11; set xrange [0:%.6g]\n", 1.05 * sweep->step[sweep->steps - 1].rate);
	fprintf(plot.to, "set arrow 1 from first %.6g, graph 0 to first %.6g, graph 1 nohead dt 2 lc rgb '#777777'\n", sweep->knee,
		sweep->knee);
	write_latencies(plot.to);
	fprintf(plot.to,
		"unset logscale y; set origin 0,0; set size 1,0.4; set yrange [0:*]; set xlabel 'requests asked for per second'; set "
		"ylabel 'good per s'\n"
		"set label 1 'knee %.4g/s' at first %.6g, graph 0.12 offset 0.6,0 textcolor rgb '#555555'; unset key\n"
		"plot x with lines dt 3 lc rgb '#999999', $steps using 1:2 with linespoints pt 7 ps 0.6 lw 1.8 lc rgb '%s'\nunset "
		"multiplot\n",
		sweep->knee, sweep->knee, PLOT_BLUE);
	return plot_end(&plot);
}
