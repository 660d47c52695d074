/* Figures drawn by gnuplot into a PNG or SVG file, whole or not at all. */
#ifndef STRATUS_CLIENTS_PLOT_H
#define STRATUS_CLIENTS_PLOT_H

#include <stdbool.h>
#include <stdio.h>

struct plot {
	FILE *to; /* takes gnuplot's language */
	char *path, *temporary;
};

/* After M. Okabe and K. Ito: the colour-blind tell them apart. */
#define PLOT_BLUE   "#0072B2"
#define PLOT_ORANGE "#E69F00"
#define PLOT_GREEN  "#009E73"
#define PLOT_RED    "#D55E00"

/* .png or .svg? */
bool plot_is_named(const char *path);

/* Is there gnuplot, and can the figure be put there? Asked before work whose result would be lost. false after a message. */
bool plot_check(const char *path);

/* Starts gnuplot with terminal, output, and axes set. false after a message. */
bool plot_begin(struct plot *plot, const char *path, int width, int height);

/* An enum client_exit, after a message when it is not CLIENT_OK. */
int plot_end(struct plot *plot);

#endif
