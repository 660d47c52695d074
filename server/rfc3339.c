#include "server/rfc3339.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Julian day of 1970-01-01T00:00:00Z. */
#define EPOCH 2440587.5

/* Two or four digits at *text, moved past. -1 when they are none. */
static int digits(const char **text, int count)
{
	int value = 0;
	for (int i = 0; i < count; i++, (*text)++) {
		if (**text < '0' || **text > '9')
			return -1;
		value = value * 10 + (**text - '0');
	}
	return value;
}

static bool expect(const char **text, const char *choices)
{
	if (**text == '\0' || !strchr(choices, **text))
		return false;
	(*text)++;
	return true;
}

static int days_in_month(int year, int month)
{
	static const int days[] = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
	bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
	return days[month - 1] + (month == 2 && leap);
}

static bool parse_date(const char **text, int *year, int *month, int *day)
{
	*year = digits(text, 4);
	if (*year < 0 || !expect(text, "-"))
		return false;
	*month = digits(text, 2);
	if (*month < 1 || *month > 12 || !expect(text, "-"))
		return false;
	*day = digits(text, 2);
	return *day >= 1 && *day <= days_in_month(*year, *month);
}

/* Seconds of the day; the fraction apart, so that the leap second can be told. */
static bool parse_time(const char **text, int *seconds, int *last, double *fraction)
{
	int hour = digits(text, 2);
	if (hour < 0 || hour > 23 || !expect(text, ":"))
		return false;
	int minute = digits(text, 2);
	if (minute < 0 || minute > 59 || !expect(text, ":"))
		return false;
	*last = digits(text, 2);
	if (*last < 0 || *last > 60)
		return false;
	*seconds = hour * 3600 + minute * 60 + *last;
	*fraction = 0;
	if (**text != '.')
		return true;
	(*text)++;
	if (**text < '0' || **text > '9')
		return false;
	for (double unit = 0.1; **text >= '0' && **text <= '9'; (*text)++, unit /= 10)
		*fraction += unit * (**text - '0');
	return true;
}

static bool parse_offset(const char **text, int *seconds)
{
	*seconds = 0;
	if (expect(text, "Zz"))
		return true;
	int sign = **text == '-' ? -1 : 1;
	if (!expect(text, "+-"))
		return false;
	int hour = digits(text, 2);
	if (hour < 0 || hour > 23 || !expect(text, ":"))
		return false;
	int minute = digits(text, 2);
	if (minute < 0 || minute > 59)
		return false;
	*seconds = sign * (hour * 3600 + minute * 60);
	return true;
}

/* Days from 1970-01-01 in the proleptic Gregorian calendar; the year counts from March, so that the leap day is its last. */
static long days_from_epoch(int year, int month, int day)
{
	long y = year + 400 - (month <= 2);
	long day_of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
	return y * 365 + y / 4 - y / 100 + y / 400 + day_of_year - 719468 - 146097;
}

bool rfc3339_parse(const char *text, double *julian_day)
{
	int year, month, day, seconds, last, offset;
	double fraction;
	if (!parse_date(&text, &year, &month, &day) || !expect(&text, "Tt") || !parse_time(&text, &seconds, &last, &fraction) ||
	    !parse_offset(&text, &offset) || *text)
		return false;
	/* 23:59:60 UTC reads as 86400 seconds here: the next day's midnight, which is where it belongs on a sundial. */
	if (last == 60 && ((seconds - offset) % 86400 + 86400) % 86400 != 0)
		return false;
	const double since_epoch_ms = days_from_epoch(year, month, day) * 86400e3 + round((seconds - offset + fraction) * 1e3);
	*julian_day = EPOCH + since_epoch_ms / 86400e3;
	return since_epoch_ms >= days_from_epoch(0, 1, 1) * 86400e3 && since_epoch_ms < days_from_epoch(10000, 1, 1) * 86400e3;
}

/* The inverse of days_from_epoch. */
static void date_of(long days, int *year, int *month, int *day)
{
	days += 719468 + 146097; /* from 1 March of the year -400 */
	const long era = days / 146097, day_of_era = days % 146097;
	const long year_of_era = (day_of_era - day_of_era / 1460 + day_of_era / 36524 - day_of_era / 146096) / 365;
	const long day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
	const long from_march = (5 * day_of_year + 2) / 153;
	*day = (int)(day_of_year - (153 * from_march + 2) / 5 + 1);
	*month = (int)(from_march < 10 ? from_march + 3 : from_march - 9);
	*year = (int)(year_of_era + era * 400 - 400 + (*month <= 2));
}

void rfc3339_format(double julian_day, char text[static RFC3339_SIZE])
{
	const double ms = round((julian_day - EPOCH) * 86400e3), days = floor(ms / 86400e3);
	const int of_day = (int)(ms - days * 86400e3);
	int year, month, day;
	date_of((long)days, &year, &month, &day);
	/* The remainders only tell the compiler how many digits there can be. */
	int length = snprintf(text, RFC3339_SIZE, "%04u-%02u-%02uT%02u:%02u:%02u", (unsigned)year % 10000, (unsigned)month % 100,
			      (unsigned)day % 100, (unsigned)of_day / 3600000 % 100, (unsigned)of_day / 60000 % 60,
			      (unsigned)of_day / 1000 % 60);
	if (of_day % 1000)
		length += snprintf(text + length, RFC3339_SIZE - (size_t)length, ".%03u", (unsigned)of_day % 1000);
	snprintf(text + length, RFC3339_SIZE - (size_t)length, "Z");
}
