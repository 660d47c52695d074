/* Log lines on standard error: one line an event, "time level message". Any thread. */
#ifndef STRATUS_RENDERER_LOG_H
#define STRATUS_RENDERER_LOG_H

enum log_level { LOG_ERROR, LOG_WARNING, LOG_INFO, LOG_DEBUG };

/* Lines above this level are dropped. LOG_INFO at start. */
void log_set_level(enum log_level level);

/* One line; format without a newline. Control characters in the text are replaced, so that input cannot forge lines. */
__attribute__((format(printf, 2, 3))) void log_line(enum log_level level, const char *format, ...);

#define log_error(...)   log_line(LOG_ERROR, __VA_ARGS__)
#define log_warning(...) log_line(LOG_WARNING, __VA_ARGS__)
#define log_info(...)    log_line(LOG_INFO, __VA_ARGS__)
#define log_debug(...)   log_line(LOG_DEBUG, __VA_ARGS__)

#endif
