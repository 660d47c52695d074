/* Undefines the guards of shaders/lib, so that the next include compiles the library once more, in another namespace. No guard of its
 * own. */
#undef SHADERS_LIB_ATMOSPHERE
#undef SHADERS_LIB_BICUBIC
#undef SHADERS_LIB_CAMERA
#undef SHADERS_LIB_COLOUR
#undef SHADERS_LIB_FIELD
#undef SHADERS_LIB_GROUND
#undef SHADERS_LIB_GROUND_PAINT
#undef SHADERS_LIB_HEIGHT
#undef SHADERS_LIB_NOISE
#undef SHADERS_LIB_OPTICS
#undef SHADERS_LIB_RADIOSITY
#undef SHADERS_LIB_SCATTERING
#undef SHADERS_LIB_SCENE_BLOCK
#undef SHADERS_LIB_SKY_TABLE
#undef SHADERS_LIB_SLAB
#undef SHADERS_LIB_SLAB_SOLVED
#undef SHADERS_LIB_SPHERE
#undef SHADERS_LIB_SUNLIGHT
#undef SHADERS_LIB_SUN_DISC
#undef SHADERS_LIB_VIEW
