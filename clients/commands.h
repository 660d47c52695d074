/* The subcommands, one file each. */
#ifndef STRATUS_CLIENTS_COMMANDS_H
#define STRATUS_CLIENTS_COMMANDS_H

#include "clients/command.h"

extern const struct command command_render;
extern const struct command command_batch;
extern const struct command command_animate;
extern const struct command command_sun;
extern const struct command command_optics;
extern const struct command command_compare;
extern const struct command command_asset;
extern const struct command command_presets;
extern const struct command command_health;
extern const struct command command_info;
extern const struct command command_bench;
extern const struct command command_completion;

#endif
