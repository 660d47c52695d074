#include "server/number_text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Shortest digits "d" or "d.ddd" and the decimal exponent of a positive number. */
static int shortest_digits(double value, char digits[static 20])
{
	char text[40];
	for (int precision = 0; precision < 17; precision++) {
		snprintf(text, sizeof text, "%.*e", precision, value);
		if (strtod(text, NULL) == value)
			break;
	}
	char *exponent = strchr(text, 'e');
	int length = 0;
	for (const char *c = text; c < exponent; c++)
		if (*c != '.')
			digits[length++] = *c;
	digits[length] = '\0';
	return atoi(exponent + 1);
}

void number_format(double value, char text[static NUMBER_TEXT_SIZE])
{
	if (value == 0) {
		strcpy(text, "0");
		return;
	}
	char digits[20];
	int exponent = shortest_digits(fabs(value), digits);
	int count = (int)strlen(digits);
	const char *sign = value < 0 ? "-" : "";
	if (exponent < -6 || exponent >= 21)
		snprintf(text, NUMBER_TEXT_SIZE, "%s%c%s%se%d", sign, digits[0], count > 1 ? "." : "", digits + 1, exponent);
	else if (exponent < 0)
		snprintf(text, NUMBER_TEXT_SIZE, "%s0.%.*s%s", sign, -exponent - 1, "00000", digits);
	else if (count <= exponent + 1)
		snprintf(text, NUMBER_TEXT_SIZE, "%s%s%.*s", sign, digits, exponent + 1 - count, "00000000000000000000");
	else
		snprintf(text, NUMBER_TEXT_SIZE, "%s%.*s.%s", sign, exponent + 1, digits, digits + exponent + 1);
}

static const char *skip_digits(const char *c)
{
	while (*c >= '0' && *c <= '9')
		c++;
	return c;
}

/* The end of a JSON number, or NULL. */
static const char *scan_number(const char *c)
{
	if (*c == '-')
		c++;
	const char *start = c;
	c = skip_digits(c);
	if (c == start || (*start == '0' && c > start + 1))
		return NULL;
	if (*c == '.') {
		start = ++c;
		c = skip_digits(c);
		if (c == start)
			return NULL;
	}
	if (*c == 'e' || *c == 'E') {
		c++;
		if (*c == '+' || *c == '-')
			c++;
		start = c;
		c = skip_digits(c);
		if (c == start)
			return NULL;
	}
	return c;
}

bool number_parse(const char *text, double *value)
{
	const char *end = scan_number(text);
	if (!end || *end)
		return false;
	double number = strtod(text, NULL);
	if (!isfinite(number))
		return false;
	*value = number + 0.0;
	return true;
}
