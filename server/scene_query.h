/* Dotted members of a query ("sun.elevation_deg=30&camera.position_m=0,0,2") into scene members. Any thread.
 *
 * Values become the JSON their field asks for and go the way of a body, so that the same errors come with the same pointers.
 */
#ifndef STRATUS_SERVER_SCENE_QUERY_H
#define STRATUS_SERVER_SCENE_QUERY_H

#include "server/problem.h"
#include "server/query.h"
#include "server/scene_fields.h"

/* Reads the members of the query. `wanted` (NULL: all) tells which fields this call knows; others are refused as unknown. */
void scene_query_read(const struct query *query, bool (*wanted)(const struct scene_field *field), struct scene_input *input,
		      struct problem *problem);

/* Refuses every member of the query's text (NULL: none): this call takes none. false when there are any, or it cannot be read. */
bool scene_query_refuse(const char *text, struct problem *problem);

/* Reads one value by its field; pointer names it in the problem. */
void scene_query_read_field(const struct scene_field *field, const char *value, const char *pointer, struct scene_input *input,
			    struct problem *problem);

#endif
