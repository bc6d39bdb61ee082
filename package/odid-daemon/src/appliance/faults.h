/* Faults of the appliance: a file for each, with a sentence for people. */
#ifndef ODID_FAULTS_H
#define ODID_FAULTS_H

#include <json-c/json_object.h>

/* Array of {"name", "sentence"}, by name. */
struct json_object *faults_list(const char *directory);

/* Makes the fault's file, or removes it when sentence is NULL. What fails is logged. */
void faults_set(const char *directory, const char *name, const char *sentence);

#endif
