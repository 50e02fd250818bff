"""What missions are and do. Each folder is one idea; imports go from later ones of this list to earlier ones only.

``spec`` what an operator describes; ``fleet`` vehicles and the links to them; ``search`` a partly known site; ``views``
what is answered; ``targets`` moving targets; ``soundings`` what is accepted; ``maps`` from soundings to products;
``report`` a survey in one document;
``live`` a mission in memory; ``flight`` what leads its vehicles; ``running`` missions that run, and who has which;
``operations`` what is done with a mission; ``forecast`` a mission flown ahead; ``preflight`` the checklist. ``service``
is the door through which REST and commands come in.
"""
