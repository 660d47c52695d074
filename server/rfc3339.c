#include "server/rfc3339.h"

#include <string.h>

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
	*julian_day = 2440587.5 + (double)days_from_epoch(year, month, day) + (seconds - offset + fraction) / 86400;
	return true;
}
