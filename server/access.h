/* Who may ask, and for how much: the key that a request shows, and what its holder may have. HTTP thread.
 *
 * A key is shown as `Authorization: Bearer KEY` and in no other way: what stands in an address stands in logs, too. The page at /, the
 * contract and the probes need none; with --open-metrics neither do scrapes.
 */
#ifndef STRATUS_SERVER_ACCESS_H
#define STRATUS_SERVER_ACCESS_H

#include "server/config.h"
#include "server/request.h"

/* The headers are in. false when the request was answered 401 or 429 instead of going on; *result is then libmicrohttpd's. */
bool access_admit(struct request *request, enum MHD_Result *result);

/* It would be rendered, this many pixels, layers counted apart. false likewise, with 429. */
bool access_admit_pixels(struct request *request, double pixels, enum MHD_Result *result);

/* Another request's render, or an image that was finished, will do: its pixels cost this key nothing. */
void access_return_pixels(struct request *request);

/* The request has ended with this status: counts it, and gives back pixels that were not rendered since the service was too busy. */
void access_end(struct request *request, unsigned status);

/* Settings that would serve strangers by mistake: without keys on an address that others reach, unless that is asked for. false and a log
 * line; a log line alone where keys would travel in the clear. Main thread. */
bool access_settings_are_safe(const struct config *config);

#endif
