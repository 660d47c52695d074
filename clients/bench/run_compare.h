/* Two runs of a load, held against each other: what of their difference is no chance. */
#ifndef STRATUS_CLIENTS_BENCH_RUN_COMPARE_H
#define STRATUS_CLIENTS_BENCH_RUN_COMPARE_H

#include "clients/client.h"

/* Reads two files of --json and prints means, percentiles and rates with the ratio of the new one to the old and its interval of 95 %;
 * errors by kind as they are. Percentiles by a bootstrap that is drawn without resampling: the k-th of n resampled values is the quantile
 * at a share of the distribution Beta(k, n+1-k). It takes the answers of a run as independent of each other. An enum client_exit:
 * CLIENT_USAGE when a file is none. */
int run_compare(const char *old_path, const char *new_path, bool as_json);

#endif
