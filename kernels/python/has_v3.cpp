// Run while the build is configured, to build for the processor at hand alone: no error is yes.
#include "level.hpp"

int main() { return terratool::is_v3() ? 0 : 1; }
