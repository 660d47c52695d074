#include "renderer/gl/timer.h"

#include <epoxy/gl.h>
#include <time.h>

void gl_timer_begin(struct gl_timer *timer)
{
	if (!timer->queries[0])
		glCreateQueries(GL_TIMESTAMP, 2, timer->queries);
	glQueryCounter(timer->queries[0], GL_TIMESTAMP);
}

void gl_timer_end(struct gl_timer *timer)
{
	glQueryCounter(timer->queries[1], GL_TIMESTAMP);
}

double gl_timer_milliseconds(const struct gl_timer *timer)
{
	GLuint64 begin = 0, end = 0;
	if (!timer->queries[0])
		return 0;
	glGetQueryObjectui64v(timer->queries[0], GL_QUERY_RESULT, &begin);
	glGetQueryObjectui64v(timer->queries[1], GL_QUERY_RESULT, &end);
	return end > begin ? (double)(end - begin) * 1e-6 : 0;
}

void gl_timer_finish(struct gl_timer *timer)
{
	if (timer->queries[0])
		glDeleteQueries(2, timer->queries);
	*timer = (struct gl_timer){0};
}

double clock_milliseconds(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (double)now.tv_sec * 1e3 + (double)now.tv_nsec * 1e-6;
}
