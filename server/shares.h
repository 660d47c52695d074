/* How many of a line's places each client may have, so that no client takes those that others come for.
 *
 * Dynamic thresholds (Choudhury, Hahne: Dynamic queue length thresholds for shared-memory packet switches, IEEE/ACM Transactions on
 * Networking 6, 1998), the factor 1: a client may have as many places as are free. One that takes all it may has half of them, two have a
 * third each, and n of them leave one part in n + 1: whoever comes new finds a place, as long as there are more places than such clients.
 *
 * One thread at a time.
 */
#ifndef STRATUS_SERVER_SHARES_H
#define STRATUS_SERVER_SHARES_H

#include <stdbool.h>
#include <stddef.h>

struct shares;

/* NULL (and a log line) when out of memory. */
struct shares *shares_create(size_t places);
/* Takes NULL. */
void shares_destroy(struct shares *shares);

/* May this client (a key; NULL: nobody in particular, who may have all) take one more? */
bool shares_allow(const struct shares *shares, const char *client);

/* It does, whatever it may; never fails: clients for whom there is no memory are nobody in particular. shares_give must follow. */
void shares_take(struct shares *shares, const char *client);
void shares_give(struct shares *shares, const char *client);

/* Places taken: in all; by this client; and those of them that are served before the client's last and one more of it, if clients take
 * turns. */
size_t shares_taken(const struct shares *shares);
size_t shares_of(const struct shares *shares, const char *client);
size_t shares_before(const struct shares *shares, const char *client);

#endif
