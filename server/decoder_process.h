/* The process that decodes pictures of strangers: it loads the image module once, and for each picture makes a copy of itself that is shut
 * in (sandbox.h) before it reads the first byte, and dies after it. It never reads a picture itself, so that none can change how the next
 * is read. */
#ifndef STRATUS_SERVER_DECODER_PROCESS_H
#define STRATUS_SERVER_DECODER_PROCESS_H

#include "renderer/image/image.h"

/* The first argument of a program that is to be such a process; the second is the image module, empty: the one beside the program. */
#define DECODER_PROCESS_FLAG "--decoder-process"

/* Serves the daemon at the other end of DECODER_SOCKET until that closes it. The only thread. */
void decoder_process_serve(const struct image_api *images);

/* The whole of such a program: its exit status. image_module: the second argument. */
int decoder_process_main(const char *image_module);

#endif
