/* Answers that are not what was asked for, in words. */
#ifndef STRATUS_CLIENTS_PROBLEM_H
#define STRATUS_CLIENTS_PROBLEM_H

#include "clients/http.h"

/* Prints an error answer on standard error: RFC 9457 problems with every member that is wrong, anything else by its status. */
void problem_print(const struct http_response *response);

#endif
