/* In what order waiting work is served, so that clients share time and not turns.
 *
 * Start-time fair queueing (Goyal, Vin, Cheng: Start-time fair queueing, IEEE/ACM Transactions on Networking 5, 1997): each client has a
 * tag, the virtual time at which its next work would begin if all clients were served at once, each at its share. The least tag is served;
 * what is served moves its client's tag by what it costs. A client that comes new begins at the present virtual time, so that its first
 * work goes next, whatever a batch has piled up. Virtual time runs at 1/n of real time while n clients have work: so nobody waits for ever,
 * even when new clients keep coming.
 *
 * A client's own work is served by rank, its arrival and a few times its cost: a preview passes the pictures of a batch, but none of them
 * for longer than these few times.
 *
 * One thread at a time; knows no clock and no renderer.
 */
#ifndef STRATUS_SERVER_FAIR_ORDER_H
#define STRATUS_SERVER_FAIR_ORDER_H

#include <stdbool.h>
#include <stddef.h>

/* Own work is passed by what is cheaper and came within so many times its cost. */
#define FAIR_ORDER_PATIENCE 3.0

struct fair_client;

/* Part of what waits. Belongs to its maker, who sets the first two. */
struct fair_entry {
	const char *client; /* key; must live until the entry is settled or dropped. NULL: as "" */
	double cost_ms;     /* predicted, above 0 */

	double rank;
	struct fair_client *owner; /* set from being added until it is settled or dropped */
	struct fair_entry *next;
};

struct fair_order;

/* NULL (and a log line) when out of memory. */
struct fair_order *fair_order_create(void);
/* Nothing may wait or run. Takes NULL. */
void fair_order_destroy(struct fair_order *order);

/* Never fails: clients for whom there is no memory share one tag. */
void fair_order_add(struct fair_order *order, struct fair_entry *entry, double now_ms);

/* What is to be served next of what is wanted; NULL: nothing. It stays in the order. */
typedef bool fair_wanted(struct fair_entry *entry, void *context);
struct fair_entry *fair_order_first(struct fair_order *order, fair_wanted *wanted, void *context);

/* Served from now on: fair_order_settle must follow. */
void fair_order_take(struct fair_order *order, struct fair_entry *entry);
/* Was served for so long: that, not the prediction, is what its client pays. */
void fair_order_settle(struct fair_order *order, struct fair_entry *entry, double took_ms);
/* Leaves without having been served. */
void fair_order_drop(struct fair_order *order, struct fair_entry *entry);

/* Another client asks for what waits, too: it goes to the line where it is served first, and who has that line pays for it. false: it is
 * where it was. */
bool fair_order_share(struct fair_order *order, struct fair_entry *entry, const char *client, double now_ms);

/* Cost of what will be served before an entry that waits, where it is or, when it is shared with this client, where it goes. */
double fair_order_ahead_of_ms(const struct fair_order *order, const struct fair_entry *entry, const char *client, double now_ms);

/* Cost of what would be served before an entry that came now, as far as anyone can know who does not know what will come. cost_ms INFINITY:
 * before the last of its client. */
double fair_order_ahead_ms(const struct fair_order *order, const char *client, double cost_ms, double now_ms);

#endif
