#include "server/fair_order.h"

#include "renderer/log.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Known as long as it has work, or is ahead of the virtual time. */
struct fair_client {
	struct fair_client *next;
	struct fair_entry *first; /* by rank */
	double start_ms;          /* virtual time at which the next of it begins */
	size_t running;
	char key[];
};

struct fair_order {
	struct fair_client *clients;
	double virtual_ms;
	/* For whom there was no memory; its key is the empty one. */
	_Alignas(struct fair_client) char anonymous[sizeof(struct fair_client) + 1];
};

struct fair_order *fair_order_create(void)
{
	struct fair_order *order = calloc(1, sizeof *order);
	if (!order)
		log_error("fair_order_create: out of memory");
	else
		order->clients = (struct fair_client *)order->anonymous;
	return order;
}

static bool is_busy(const struct fair_client *client)
{
	return client->first || client->running;
}

/* Forgets who neither has work nor is ahead of the others. */
static void forget(struct fair_order *order, bool all)
{
	for (struct fair_client **link = &order->clients; *link;) {
		struct fair_client *client = *link;
		if ((char *)client == order->anonymous || is_busy(client) || (!all && client->start_ms > order->virtual_ms)) {
			link = &client->next;
			continue;
		}
		*link = client->next;
		free(client);
	}
}

void fair_order_destroy(struct fair_order *order)
{
	if (!order)
		return;
	forget(order, true);
	free(order);
}

static struct fair_client *find(const struct fair_order *order, const char *key)
{
	struct fair_client *client = order->clients;
	while (client && strcmp(client->key, key) != 0)
		client = client->next;
	return client;
}

static struct fair_client *find_or_make(struct fair_order *order, const char *key)
{
	struct fair_client *client = find(order, key);
	if (client)
		return client;
	const size_t size = strlen(key) + 1;
	client = calloc(1, sizeof *client + size);
	if (!client)
		return (struct fair_client *)order->anonymous;
	memcpy(client->key, key, size);
	client->next = order->clients;
	order->clients = client;
	return client;
}

static size_t busy_count(const struct fair_order *order)
{
	size_t count = 0;
	for (const struct fair_client *client = order->clients; client; client = client->next)
		count += is_busy(client);
	return count;
}

static double rank_of(double cost_ms, double now_ms)
{
	return now_ms + FAIR_ORDER_PATIENCE * cost_ms;
}

static void link_entry(struct fair_order *order, struct fair_client *client, struct fair_entry *entry)
{
	/* Who had nothing waiting has saved up nothing. */
	if (!client->first)
		client->start_ms = fmax(client->start_ms, order->virtual_ms);
	entry->owner = client;
	struct fair_entry **link = &client->first;
	while (*link && (*link)->rank <= entry->rank)
		link = &(*link)->next;
	entry->next = *link;
	*link = entry;
}

void fair_order_add(struct fair_order *order, struct fair_entry *entry, double now_ms)
{
	entry->rank = rank_of(entry->cost_ms, now_ms);
	link_entry(order, find_or_make(order, entry->client ? entry->client : ""), entry);
}

static struct fair_entry *first_of(const struct fair_client *client, fair_wanted *wanted, void *context)
{
	struct fair_entry *entry = client->first;
	while (entry && wanted && !wanted(entry, context))
		entry = entry->next;
	return entry;
}

struct fair_entry *fair_order_first(struct fair_order *order, fair_wanted *wanted, void *context)
{
	struct fair_entry *best = NULL;
	for (const struct fair_client *client = order->clients; client; client = client->next) {
		if (best && client->start_ms > best->owner->start_ms)
			continue;
		struct fair_entry *entry = first_of(client, wanted, context);
		const bool earlier = entry && (!best || client->start_ms < best->owner->start_ms);
		if (earlier || (entry && entry->cost_ms < best->cost_ms))
			best = entry;
	}
	return best;
}

static void unlink_entry(struct fair_entry *entry)
{
	struct fair_entry **link = &entry->owner->first;
	while (*link != entry)
		link = &(*link)->next;
	*link = entry->next;
}

void fair_order_take(struct fair_order *order, struct fair_entry *entry)
{
	struct fair_client *client = entry->owner;
	unlink_entry(entry);
	client->running++;
	order->virtual_ms = fmax(order->virtual_ms, client->start_ms);
	client->start_ms += entry->cost_ms;
}

/* A time without work ends all accounts. */
static void tidy(struct fair_order *order)
{
	const bool idle = busy_count(order) == 0;
	forget(order, idle);
	if (!idle)
		return;
	order->virtual_ms = 0;
	((struct fair_client *)order->anonymous)->start_ms = 0;
}

void fair_order_settle(struct fair_order *order, struct fair_entry *entry, double took_ms)
{
	struct fair_client *client = entry->owner;
	order->virtual_ms += took_ms / (double)busy_count(order);
	client->start_ms += took_ms - entry->cost_ms;
	client->running--;
	entry->owner = NULL;
	tidy(order);
}

void fair_order_drop(struct fair_order *order, struct fair_entry *entry)
{
	unlink_entry(entry);
	entry->owner = NULL;
	tidy(order);
}

/* What another client is served before the virtual time at which the new entry begins. */
static double served_before(const struct fair_client *client, double start_ms)
{
	double tag = client->start_ms, sum = 0;
	for (const struct fair_entry *entry = client->first; entry && tag < start_ms; entry = entry->next) {
		sum += entry->cost_ms;
		tag += entry->cost_ms;
	}
	return sum;
}

/* Where an entry stands or would stand: the virtual time at which it begins, and the cost of what its client has before it. */
struct place {
	double start_ms, own_ms;
};

static struct place new_place(const struct fair_order *order, const struct fair_client *own, double rank)
{
	struct place place = {own ? own->start_ms : order->virtual_ms, 0};
	if (own && !own->first)
		place.start_ms = fmax(place.start_ms, order->virtual_ms);
	for (const struct fair_entry *entry = own ? own->first : NULL; entry && entry->rank <= rank; entry = entry->next)
		place.own_ms += entry->cost_ms;
	place.start_ms += place.own_ms;
	return place;
}

static struct place present_place(const struct fair_entry *sought)
{
	struct place place = {0};
	for (const struct fair_entry *entry = sought->owner->first; entry != sought; entry = entry->next)
		place.own_ms += entry->cost_ms;
	place.start_ms = sought->owner->start_ms + place.own_ms;
	return place;
}

static double before(const struct fair_order *order, const struct fair_client *own, struct place place)
{
	double sum = place.own_ms;
	for (const struct fair_client *client = order->clients; client; client = client->next)
		if (client != own)
			sum += served_before(client, place.start_ms);
	return sum;
}

double fair_order_ahead_ms(const struct fair_order *order, const char *key, double cost_ms, double now_ms)
{
	const struct fair_client *own = find(order, key ? key : "");
	return before(order, own, new_place(order, own, rank_of(cost_ms, now_ms)));
}

/* Is it served sooner when it comes to a client's line now? */
static bool is_sooner(const struct fair_order *order, const struct fair_entry *entry, const struct fair_client *client, double now_ms)
{
	return client != entry->owner && new_place(order, client, rank_of(entry->cost_ms, now_ms)).start_ms < present_place(entry).start_ms;
}

double fair_order_ahead_of_ms(const struct fair_order *order, const struct fair_entry *entry, const char *key, double now_ms)
{
	const struct fair_client *client = find(order, key ? key : "");
	if (is_sooner(order, entry, client, now_ms))
		return before(order, client, new_place(order, client, rank_of(entry->cost_ms, now_ms)));
	return before(order, entry->owner, present_place(entry));
}

bool fair_order_share(struct fair_order *order, struct fair_entry *entry, const char *key, double now_ms)
{
	if (!is_sooner(order, entry, find(order, key ? key : ""), now_ms))
		return false;
	unlink_entry(entry);
	entry->client = key;
	fair_order_add(order, entry, now_ms);
	forget(order, false); /* whose line that was, when it is empty now */
	return true;
}
