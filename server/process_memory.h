/* Memory of this process. Any thread. */
#ifndef STRATUS_SERVER_PROCESS_MEMORY_H
#define STRATUS_SERVER_PROCESS_MEMORY_H

/* Resident, bytes; 0 where the system does not say. */
double process_resident_bytes(void);

#endif
