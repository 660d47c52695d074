#include "server/shares.h"

#include "renderer/log.h"

#include <stdlib.h>
#include <string.h>

/* Known as long as it has places. */
struct share {
	struct share *next;
	size_t count;
	char client[];
};

struct shares {
	struct share *first;
	size_t places, taken, of_nobody;
};

struct shares *shares_create(size_t places)
{
	struct shares *shares = calloc(1, sizeof *shares);
	if (!shares)
		log_error("shares_create: out of memory");
	else
		shares->places = places;
	return shares;
}

void shares_destroy(struct shares *shares)
{
	if (!shares)
		return;
	for (struct share *share; (share = shares->first);) {
		shares->first = share->next;
		free(share);
	}
	free(shares);
}

static struct share *find(const struct shares *shares, const char *client)
{
	struct share *share = client ? shares->first : NULL;
	while (share && strcmp(share->client, client) != 0)
		share = share->next;
	return share;
}

static struct share *find_or_make(struct shares *shares, const char *client)
{
	struct share *share = find(shares, client);
	if (share || !client)
		return share;
	const size_t size = strlen(client) + 1;
	share = calloc(1, sizeof *share + size);
	if (!share)
		return NULL;
	memcpy(share->client, client, size);
	share->next = shares->first;
	shares->first = share;
	return share;
}

bool shares_allow(const struct shares *shares, const char *client)
{
	return shares->taken < shares->places && (!client || shares_of(shares, client) < shares->places - shares->taken);
}

void shares_take(struct shares *shares, const char *client)
{
	struct share *share = find_or_make(shares, client);
	shares->taken++;
	++*(share ? &share->count : &shares->of_nobody);
}

void shares_give(struct shares *shares, const char *client)
{
	struct share *share = find(shares, client);
	shares->taken--;
	if (--*(share ? &share->count : &shares->of_nobody) > 0 || !share)
		return;
	struct share **link = &shares->first;
	while (*link != share)
		link = &(*link)->next;
	*link = share->next;
	free(share);
}

size_t shares_taken(const struct shares *shares)
{
	return shares->taken;
}

size_t shares_of(const struct shares *shares, const char *client)
{
	const struct share *share = find(shares, client);
	return share ? share->count : client ? 0 : shares->of_nobody;
}

static size_t lesser(size_t a, size_t b)
{
	return a < b ? a : b;
}

size_t shares_before(const struct shares *shares, const char *client)
{
	const struct share *own = find(shares, client);
	const size_t count = shares_of(shares, client);
	size_t before = count + (client ? lesser(shares->of_nobody, count) : 0);
	for (const struct share *share = shares->first; share; share = share->next)
		if (share != own)
			before += lesser(share->count, count);
	return before;
}
