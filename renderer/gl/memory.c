#include "renderer/gl/memory.h"

#include <epoxy/gl.h>

double gl_free_memory(void)
{
	GLint kilobytes[4] = {-1}; /* of GL_ATI_meminfo the first is the sum */
	if (epoxy_has_gl_extension("GL_NVX_gpu_memory_info"))
		glGetIntegerv(GL_GPU_MEMORY_INFO_CURRENT_AVAILABLE_VIDMEM_NVX, kilobytes);
	else if (epoxy_has_gl_extension("GL_ATI_meminfo"))
		glGetIntegerv(GL_TEXTURE_FREE_MEMORY_ATI, kilobytes);
	return kilobytes[0] < 0 ? -1 : 1024.0 * kilobytes[0];
}
