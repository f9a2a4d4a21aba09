"""What the Snakefile asks first: is the configuration sound, which objects are there, which code makes what?"""
