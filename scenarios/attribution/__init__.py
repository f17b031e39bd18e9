"""Which stage of the method is to blame: stages replaced by the truth, one at a time and all but one."""
