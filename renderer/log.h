/* Log lines on standard error: one line an event, either as text, "time level message", or as one JSON object. Any thread. */
#ifndef STRATUS_RENDERER_LOG_H
#define STRATUS_RENDERER_LOG_H

#include <stdbool.h>
#include <stddef.h>

enum log_level { LOG_ERROR, LOG_WARNING, LOG_INFO, LOG_DEBUG };
enum log_format { LOG_TEXT, LOG_JSON };

/* Lines above this level are dropped. LOG_INFO at start. */
void log_set_level(enum log_level level);
bool log_is_wanted(enum log_level level);

/* LOG_TEXT at start. */
void log_set_format(enum log_format format);
enum log_format log_current_format(void);

/* One line; format without a newline. Control characters in the text are replaced, so that input cannot forge lines. In JSON the text is
 * the member "message". */
__attribute__((format(printf, 2, 3))) void log_line(enum log_level level, const char *format, ...);

/* One line whose content is written already, in the current format: text behind time and level, or members of the object behind those two,
 * without braces. Nothing in it is replaced. */
void log_record(enum log_level level, const char *content);

/* Room for the JSON string of a text of so many bytes, quotes and the NUL included. */
#define LOG_JSON_STRING_SIZE(length) (6 * (length) + 3)

/* Writes a text as a JSON string, in quotes: control characters are escaped, bytes that are no UTF-8 become U+FFFD. Cut where `size`, at
 * least 3, ends. Returns the length. */
size_t log_json_string(const char *text, char *string, size_t size);

#define log_error(...)   log_line(LOG_ERROR, __VA_ARGS__)
#define log_warning(...) log_line(LOG_WARNING, __VA_ARGS__)
#define log_info(...)    log_line(LOG_INFO, __VA_ARGS__)
#define log_debug(...)   log_line(LOG_DEBUG, __VA_ARGS__)

#endif
