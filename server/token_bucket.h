/* So much a minute: what is not used is kept, up to a minute's worth. One thread at a time; times on the clock of clock_now_ms. */
#ifndef STRATUS_SERVER_TOKEN_BUCKET_H
#define STRATUS_SERVER_TOKEN_BUCKET_H

struct token_bucket {
	double per_minute; /* INFINITY: as much as one likes */
	double level;      /* what is left, at most per_minute; below 0: taken in advance */
	double filled_ms;  /* when it was so */
};

/* A full one. */
void token_bucket_init(struct token_bucket *bucket, double per_minute, double now_ms);

/* Changes how much it is; what was taken of it stays taken. */
void token_bucket_change(struct token_bucket *bucket, double per_minute, double now_ms);

/* Takes an amount, from 0, and returns 0; or takes nothing and returns the milliseconds until it would. More than a minute's worth is taken
 * of a full bucket, which then owes it. */
double token_bucket_take(struct token_bucket *bucket, double amount, double now_ms);

/* Gives back what was taken and not used. */
void token_bucket_give_back(struct token_bucket *bucket, double amount);

#endif
