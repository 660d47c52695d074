/* What drivers say of the device's memory. The thread that owns the context calls. */
#ifndef STRATUS_RENDERER_GL_MEMORY_H
#define STRATUS_RENDERER_GL_MEMORY_H

/* Bytes of dedicated memory that no process uses; negative where the driver does not say (GL_NVX_gpu_memory_info, GL_ATI_meminfo). */
double gl_free_memory(void);

#endif
