/* SPDX-License-Identifier: MIT OR Apache-2.0 */
/** @file
 * Steps an FMU of the compensation on this system, by declarations of its own: step LIBRARY GUID RESOURCES
 *
 * RESOURCES is a file URI. Prints the command of the generator after each of 500 steps, with all digits: the same on every system. */
#include <stdio.h>
#include <stdlib.h>

#ifdef _WIN32
#include <windows.h>
#define OPEN(name) ((void *)LoadLibraryA(name))
#define FIND(library, name) ((void *)GetProcAddress((HMODULE)(library), name))
#else
#include <dlfcn.h>
#define OPEN(name) dlopen(name, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#endif

typedef void *component;
typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} callbacks;

static void logger(void *environment, const char *name, int status, const char *category, const char *message, ...)
{
    (void)environment;
    fprintf(stderr, "%s, status %d, %s: %s\n", name, status, category, message);
}

static void *find(void *library, const char *name)
{
    void *function = FIND(library, name);
    if (!function) {
        fprintf(stderr, "%s is not exported\n", name);
        exit(1);
    }
    return function;
}

/* What the model description of the compensation says. */
enum { OUTPUT_COMMAND = 0, TORQUE = 3, GENERATOR_COMMAND = 19 };

int main(int count, char **arguments)
{
    if (count != 4) {
        fprintf(stderr, "step LIBRARY GUID RESOURCES\n");
        return 2;
    }
    void *library = OPEN(arguments[1]);
    if (!library) {
        fprintf(stderr, "%s cannot be loaded\n", arguments[1]);
        return 1;
    }
    callbacks with = {logger, calloc, free, NULL, NULL};
    component (*instantiate)(const char *, int, const char *, const char *, const callbacks *, int, int) = find(library, "fmi2Instantiate");
    int (*setup)(component, int, double, double, int, double) = find(library, "fmi2SetupExperiment");
    int (*enter)(component) = find(library, "fmi2EnterInitializationMode");
    int (*leave)(component) = find(library, "fmi2ExitInitializationMode");
    int (*set)(component, const unsigned *, size_t, const double *) = find(library, "fmi2SetReal");
    int (*get)(component, const unsigned *, size_t, double *) = find(library, "fmi2GetReal");
    int (*step)(component, double, double, int) = find(library, "fmi2DoStep");
    int (*terminate)(component) = find(library, "fmi2Terminate");
    void (*release)(component) = find(library, "fmi2FreeInstance");

    const int co_simulation = 1;
    component joint = instantiate("step", co_simulation, arguments[2], arguments[3], &with, 0, 1);
    if (!joint || setup(joint, 0, 0.0, 0.0, 0, 0.0) || enter(joint) || leave(joint)) {
        fprintf(stderr, "the FMU does not start\n");
        return 1;
    }
    const unsigned inputs[2] = {OUTPUT_COMMAND, TORQUE}, output = GENERATOR_COMMAND;
    const double seconds = 0.002;
    for (int k = 0; k < 500; k++) {
        const double values[2] = {1e-4 * k, 20.0};
        double command = 0.0;
        if (set(joint, inputs, 2, values) || step(joint, seconds * k, seconds, 1) || get(joint, &output, 1, &command)) {
            fprintf(stderr, "step %d failed\n", k);
            return 1;
        }
        printf("%.17g\n", command);
    }
    terminate(joint);
    release(joint);
    return 0;
}
