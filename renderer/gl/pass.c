#include "renderer/gl/pass.h"

#include "renderer/gl/source.h"
#include "renderer/log.h"

#include <epoxy/gl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Side of a compute work group: 64 invocations, within the 1024 that OpenGL 4.5 guarantees. */
enum { GROUP_SIDE = 8 };

struct pass {
	GLuint program;
	GLuint framebuffer, vertex_array; /* fragment passes alone */
	int outputs;
	bool compute, adds;
	GLint arguments, size; /* size: of compute passes */
	unsigned reads;        /* bit i: the program reads sampler i */
	char name[64];
};

/* One triangle over all, which hands on the scene block. */
static void append_vertex_wrapper(struct source *source)
{
	source_print(source, "void scene_hand_on();\n"
			     "void main() {\n\tscene_hand_on();\n"
			     "\tgl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);\n}\n");
}

static void append_fragment_wrapper(struct source *source, int outputs)
{
	source_print(source, "#define STORE(i, value) output_##i = (value)\n");
	for (int i = 0; i < outputs; i++)
		source_print(source, "layout(location = %d) out vec4 output_%d;\n", i, i);
	source_print(source, "void pass(ivec2 pixel);\nvoid main() { pass(ivec2(gl_FragCoord.xy)); }\n");
}

static void append_compute_wrapper(struct source *source, int outputs, bool adds)
{
	static const char at[] = "ivec2(gl_GlobalInvocationID.xy) + pass_size.zw";
	source_print(source, "layout(local_size_x = %d, local_size_y = %d) in;\n", GROUP_SIDE, GROUP_SIDE);
	source_print(source, "uniform ivec4 pass_size; // columns, rows, first column, first row\n");
	if (adds)
		source_print(source, "#define STORE(i, value) imageStore(output_##i, %s, imageLoad(output_##i, %s) + (value))\n", at, at);
	else
		source_print(source, "#define STORE(i, value) imageStore(output_##i, %s, value)\n", at);
	for (int i = 0; i < outputs; i++)
		source_print(source, "layout(binding = %d%s uniform image2D output_%d;\n", i, adds ? ", rgba32f)" : ") writeonly", i);
	source_print(source, "void pass(ivec2 pixel);\nvoid main() {\n"
			     "\tivec2 pixel = ivec2(gl_GlobalInvocationID.xy);\n"
			     "\tif (all(lessThan(pixel, pass_size.xy))) pass(pixel + pass_size.zw);\n}\n");
}

static bool assemble(struct source *source, const struct pass_compiler *compiler, const struct pass_desc *desc, GLenum type)
{
	const char *kind = type == GL_COMPUTE_SHADER ? "COMPUTE" : type == GL_VERTEX_SHADER ? "VERTEX" : "FRAGMENT";
	source_print(source, "#version 450 core\n#define PASS_%s 1\n", kind);
	if (compiler->software && type != GL_COMPUTE_SHADER)
		source_print(source, "#define PASS_SOFTWARE 1\n");
	if (desc->defines)
		source_print(source, "%s", desc->defines);
	if (type == GL_COMPUTE_SHADER)
		append_compute_wrapper(source, desc->outputs, desc->adds);
	else if (type == GL_VERTEX_SHADER)
		append_vertex_wrapper(source);
	else
		append_fragment_wrapper(source, desc->outputs);
	return source_include(source, compiler->shader_dir, type == GL_VERTEX_SHADER ? "shaders/lib/scene_block.glsl" : desc->file);
}

/* Drivers say where by a number of a file and a line, "2:17(5)" or "2(17)": its name comes before that. */
static void report_place(const struct source *source, const char *text)
{
	int file, line;
	for (; text; text = strchr(text, '\n')) {
		text += strspn(text, "\n");
		if ((sscanf(text, "%d:%d", &file, &line) != 2 && sscanf(text, "%d(%d)", &file, &line) != 2) || file < 0 ||
		    file >= source->file_count || !strstr(text, "rror"))
			continue;
		log_error("gl: %s:%d: %.*s", source->files[file], line, (int)strcspn(text, "\n"), text);
		return;
	}
}

/* The info log is read whether or not it failed: warnings belong into the log too. */
static bool report(const char *what, const char *name, GLint ok, const char *text)
{
	const size_t length = strcspn(text, "\0");
	if (length > 0)
		log_line(ok ? LOG_WARNING : LOG_ERROR, "gl: %s %s: %s", what, name, text);
	else if (!ok)
		log_error("gl: %s %s failed without a message", what, name);
	return ok;
}

static GLuint compile(GLenum type, const struct source *source, const char *name)
{
	char message[4096] = "";
	GLint ok = 0;
	const GLuint shader = glCreateShader(type);
	glShaderSource(shader, 1, (const GLchar *const *)&source->text, NULL);
	glCompileShader(shader);
	glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
	glGetShaderInfoLog(shader, sizeof message, NULL, message);
	if (!report("compiling", name, ok, message)) {
		report_place(source, message);
		glDeleteShader(shader);
		return 0;
	}
	return shader;
}

static _Thread_local bool refused;

bool pass_was_refused(void)
{
	const bool was_refused = refused;
	refused = false;
	return was_refused;
}

/* vertices: the vertex program, of fragment passes. */
static bool link(struct pass *pass, const struct source *text, const struct source *vertices)
{
	char message[4096] = "";
	GLint ok = 0;
	GLuint shaders[2] = {0};
	if (pass->compute) {
		shaders[0] = compile(GL_COMPUTE_SHADER, text, pass->name);
	} else {
		shaders[0] = compile(GL_FRAGMENT_SHADER, text, pass->name);
		shaders[1] = compile(GL_VERTEX_SHADER, vertices, pass->name);
	}
	if (shaders[0] && (pass->compute || shaders[1])) {
		pass->program = glCreateProgram();
		for (int i = 0; i < 2 && shaders[i]; i++)
			glAttachShader(pass->program, shaders[i]);
		glLinkProgram(pass->program);
		glGetProgramiv(pass->program, GL_LINK_STATUS, &ok);
		glGetProgramInfoLog(pass->program, sizeof message, NULL, message);
		ok = report("linking", pass->name, ok, message);
	}
	for (int i = 0; i < 2; i++)
		if (shaders[i])
			glDeleteShader(shaders[i]);
	return ok;
}

static void look_up_uniforms(struct pass *pass, const struct pass_desc *desc)
{
	pass->arguments = glGetUniformLocation(pass->program, "arguments");
	pass->size = glGetUniformLocation(pass->program, "pass_size");
	for (int i = 0; i < PASS_SAMPLERS_MAX && desc->samplers[i]; i++) {
		const GLint location = glGetUniformLocation(pass->program, desc->samplers[i]);
		if (location < 0)
			continue; /* the compiler found it unused */
		glProgramUniform1i(pass->program, location, i);
		pass->reads |= 1u << i;
	}
}

struct pass *pass_create(const struct pass_compiler *compiler, const struct pass_desc *desc)
{
	struct source source = {0}, vertices = {0};
	struct pass *pass = calloc(1, sizeof *pass);
	if (!pass)
		return NULL;
	snprintf(pass->name, sizeof pass->name, "%s", desc->file);
	pass->outputs = desc->outputs;
	pass->adds = desc->adds;
	pass->compute = compiler->kind == PASS_COMPUTE || desc->outputs == 0;
	if (!assemble(&source, compiler, desc, pass->compute ? GL_COMPUTE_SHADER : GL_FRAGMENT_SHADER) ||
	    (!pass->compute && !assemble(&vertices, compiler, desc, GL_VERTEX_SHADER)) || !link(pass, &source, &vertices)) {
		refused = true;
		goto fail;
	}
	look_up_uniforms(pass, desc);
	if (!pass->compute) {
		glCreateFramebuffers(1, &pass->framebuffer);
		glCreateVertexArrays(1, &pass->vertex_array);
	}
	source_finish(&source);
	source_finish(&vertices);
	return pass;

fail:
	source_finish(&source);
	source_finish(&vertices);
	pass_destroy(pass);
	return NULL;
}

void pass_destroy(struct pass *pass)
{
	if (!pass)
		return;
	if (pass->vertex_array)
		glDeleteVertexArrays(1, &pass->vertex_array);
	if (pass->framebuffer)
		glDeleteFramebuffers(1, &pass->framebuffer);
	if (pass->program)
		glDeleteProgram(pass->program);
	free(pass);
}

static void run_compute(const struct pass *pass, const struct pass_run *run, int width, int height)
{
	for (int i = 0; i < pass->outputs; i++) {
		/* Stores to an image unit without a texture are discarded. */
		const struct texture *target = run->targets[i];
		glBindImageTexture((GLuint)i, target ? target->id : 0, target ? run->level : 0, GL_FALSE, 0,
				   pass->adds ? GL_READ_WRITE : GL_WRITE_ONLY,
				   texture_internal_format(target ? target->format : TEXTURE_RGBA32F));
	}
	glProgramUniform4i(pass->program, pass->size, width, height, run->first_column, run->first_row);
	glDispatchCompute((GLuint)(width + GROUP_SIDE - 1) / GROUP_SIDE, (GLuint)(height + GROUP_SIDE - 1) / GROUP_SIDE, 1);
	glMemoryBarrier(GL_ALL_BARRIER_BITS);
}

static void run_fragment(const struct pass *pass, const struct pass_run *run, int width, int height)
{
	static const GLenum attachments[PASS_OUTPUTS_MAX] = {GL_COLOR_ATTACHMENT0, GL_COLOR_ATTACHMENT1, GL_COLOR_ATTACHMENT2,
							     GL_COLOR_ATTACHMENT3, GL_COLOR_ATTACHMENT4, GL_COLOR_ATTACHMENT5,
							     GL_COLOR_ATTACHMENT6, GL_COLOR_ATTACHMENT7};
	GLenum buffers[PASS_OUTPUTS_MAX];
	for (int i = 0; i < pass->outputs; i++) {
		buffers[i] = run->targets[i] ? attachments[i] : GL_NONE;
		glNamedFramebufferTexture(pass->framebuffer, attachments[i], run->targets[i] ? run->targets[i]->id : 0,
					  run->targets[i] ? run->level : 0);
	}
	glNamedFramebufferDrawBuffers(pass->framebuffer, pass->outputs, buffers);
	glBindFramebuffer(GL_DRAW_FRAMEBUFFER, pass->framebuffer);
	glViewport(0, 0, run->first_column + width, run->first_row + height);
	glEnable(GL_SCISSOR_TEST);
	glScissor(run->first_column, run->first_row, width, height);
	glBindVertexArray(pass->vertex_array);
	if (pass->adds) {
		glEnable(GL_BLEND);
		glBlendFunc(GL_ONE, GL_ONE);
	}
	glDrawArrays(GL_TRIANGLES, 0, 3);
	glDisable(GL_BLEND);
	/* Detached again, so that a texture deleted later is really freed, and none stays attached while it is sampled. */
	for (int i = 0; i < pass->outputs; i++)
		glNamedFramebufferTexture(pass->framebuffer, attachments[i], 0, 0);
}

static _Thread_local bool lacked_texture;

bool pass_lacked_texture(void)
{
	const bool lacked = lacked_texture;
	lacked_texture = false;
	return lacked;
}

/* A unit that nothing is bound to would hold what another pass left there. */
static void bind_textures(const struct pass *pass, const struct texture *const *textures)
{
	for (unsigned i = 0; i < PASS_SAMPLERS_MAX; i++) {
		const bool given = textures[i] && textures[i]->id;
		if (given)
			glBindTextureUnit(i, textures[i]->id);
		if (given || !(pass->reads >> i & 1))
			continue;
		log_error("gl: %s reads a texture that it was not given, number %u", pass->name, i);
		lacked_texture = true;
	}
}

static int level_size(int size, int level)
{
	return size >> level > 0 ? size >> level : 1;
}

void pass_run(const struct pass *pass, const struct pass_run *run)
{
	const int width = run->width ? run->width : level_size(run->targets[0]->width, run->level);
	const int height = run->height ? run->height : level_size(run->targets[0]->height, run->level);

	glPushDebugGroup(GL_DEBUG_SOURCE_APPLICATION, 0, -1, pass->name);
	glUseProgram(pass->program);
	if (pass->arguments >= 0)
		glProgramUniform4fv(pass->program, pass->arguments, PASS_ARGUMENTS, &run->arguments[0][0]);
	bind_textures(pass, run->samplers);
	if (pass->compute)
		run_compute(pass, run, width, height);
	else
		run_fragment(pass, run, width, height);
	glPopDebugGroup();
}
